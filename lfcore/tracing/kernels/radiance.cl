// Linear radiance of bundles, as floats: no planes, no frames, nothing clamped.
#include "paint.cl"

kernel void scratch_words(global int *words) { *words = EASEL_WORDS; }

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void trace_radiance(BVH_PARAMETERS,
                    SURFACES_PARAMETERS,
                    RAYS_PARAMETERS,
                    const float pixel,
                    global int *restrict next,
                    global uint *restrict scratch,    // (workers, EASEL_WORDS)
                    global float *restrict radiance)  // (E, rows, columns, 3)
{
    const Bvh bvh = MAKE_BVH;
    const Surfaces surfaces = MAKE_SURFACES;
    const Rays rays = MAKE_RAYS;
    Easel easel = make_easel(scratch + get_global_id(0) * (ulong)EASEL_WORDS);
    BeamWork work;
    for (int beam = atomic_inc(next); beam < n_beams; beam = atomic_inc(next)) {
        start_beam(&rays, beam, &work);
        see_beam(&bvh, &surfaces, &rays, &work, &easel);
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            if (work.block[block].z_far < 0.0f) continue;
            paint_block(&bvh, &surfaces, &rays, &work, block, pixel, &easel);
            const int2 where = block_position(&work, block);
            global float *to = radiance + 3 * ((ulong)work.element[block / ELEMENT_BLOCKS] * rows * columns);
            for (int y = 0; y < BLOCK && where.y + y < rows; ++y)
                for (int x = 0; x < BLOCK && where.x + x < columns; ++x) {
                    global const float *c = easel.colours.base + y * BLOCK + x;
                    vstore3((float3)(c[0], c[BLOCK_RAYS], c[2 * BLOCK_RAYS]), (ulong)(where.y + y) * columns + where.x + x, to);
                }
        }
    }
}
