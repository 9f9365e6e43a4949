// Visibility alone: the closest triangle and its depth for every ray of a job.
#include "beam.cl"

#define SCRATCH_FLOATS (2 * BEAM_BLOCKS * BLOCK_RAYS + 7 * LIST)

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void slab_hits(BVH_PARAMETERS,
               RAYS_PARAMETERS,
               global int *restrict next,      // (1,) the next beam to take
               global float *restrict scratch, // (workers, SCRATCH_FLOATS)
               global float *restrict depth,   // (E, rows, columns)
               global int *restrict triangle)  // (E, rows, columns)
{
    const Bvh bvh = MAKE_BVH;
    const Rays rays = MAKE_RAYS;
    global float *z = scratch + get_global_id(0) * (ulong)SCRATCH_FLOATS;
    global int *ids = (global int *)(z + BEAM_BLOCKS * BLOCK_RAYS);
    LeafList list = {(global float *)(ids + BEAM_BLOCKS * BLOCK_RAYS), 0, LIST, 0};
    list.leaf = (global int *)(list.boxes + 6 * LIST);
    BeamWork work;
    for (int beam = atomic_inc(next); beam < n_beams; beam = atomic_inc(next)) {
        start_beam(&rays, beam, &work);
        see(&bvh, &rays, &work, &list, z, ids);
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            if (work.block[block].z_far < 0.0f) continue;
            materialise(work.block + block, z + block * BLOCK_RAYS, ids + block * BLOCK_RAYS);
            if (!WRITE) continue;
            const int2 where = block_position(&work, block);
            const int x0 = where.x, y0 = where.y;
            const ulong base = (ulong)work.element[block / ELEMENT_BLOCKS] * rows * columns;
            for (int row = 0; row < BLOCK && y0 + row < rows; ++row)
                for (int column = 0; column < BLOCK && x0 + column < columns; column += LANES) {
                    global const float *zr = z + block * BLOCK_RAYS + row * BLOCK + column;
                    global const int *ir = ids + block * BLOCK_RAYS + row * BLOCK + column;
                    const ulong at = base + (ulong)(y0 + row) * columns + x0 + column;
                    if (x0 + column + LANES <= columns) {
                        VSTORE(VLOAD(zr), depth + at);
                        VSTORE(VLOAD(ir), triangle + at);
                    } else
                        for (int k = 0; x0 + column + k < columns && k < LANES; ++k) {
                            depth[at + k] = zr[k];
                            triangle[at + k] = ir[k];
                        }
                }
        }
    }
}
