// The whole of Algorithms 1 and 3 for one chunk of a tile: see, shade, cast shadows, form sensor planes
// (PLANES) and write encoder-ready frames (FRAMES).
#include "paint.cl"
#include "planes.cl"
#include "frames.cl"

#define SCRATCH_WORDS (EASEL_WORDS + PLANES * TABLE_WORDS)

kernel void scratch_words(global int *words) { *words = SCRATCH_WORDS; }

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void trace_slab(BVH_PARAMETERS,
                SURFACES_PARAMETERS,
                RAYS_PARAMETERS,
                const float pixel,                      // tangent between neighbouring pixels
                global int *restrict next,
                global uint *restrict scratch,          // (workers, SCRATCH_WORDS)
                global const int4 *restrict places,     // (E,) frame, x0, y0, pixel u + (v << 16)
                global uchar *restrict frames,
                const int frame_width,
                const int frame_height,
                const int n_planes,
                const int8 region,                      // left, top, width, height, size M, blocks, views N, 0
                global const int4 *restrict plane_info,
                global const int *restrict runs,
                global const uchar *restrict masks,
                global const uchar *restrict kinds,
                global ulong4 *restrict sums)           // (workers, planes, height, width)
{
    const Bvh bvh = MAKE_BVH;
    const Surfaces surfaces = MAKE_SURFACES;
    const Rays rays = MAKE_RAYS;
    const Frames out = {places, frames, frame_width, frame_height};
    const ulong plane_words = (ulong)n_planes * region.s2 * region.s3;
    const Planes planes = {n_planes, region.s5, region.s0, region.s1, region.s2, region.s3, region.s4,
                           plane_info, runs, masks, kinds, sums + get_global_id(0) * plane_words};
    global uint *memory = scratch + get_global_id(0) * (ulong)SCRATCH_WORDS;
    Easel easel = make_easel(memory);
    global uint *table = memory + EASEL_WORDS;
    BeamWork work;
    for (int beam = atomic_inc(next); beam < n_beams; beam = atomic_inc(next)) {
        start_beam(&rays, beam, &work);
#if PLANES && !FRAMES && !VIEWS
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            const int2 where = block_position(&work, block) / BLOCK;
            if (work.block[block].z_far < 0.0f) continue;
            int open = 0;
            for (int plane = 0; plane < n_planes; ++plane)
                open |= kinds[(plane_info[plane].x * region.s5 + where.y) * region.s5 + where.x];
            if (!open) work.block[block].z_far = -1.0f;
        }
#endif
        see_beam(&bvh, &surfaces, &rays, &work, &easel);
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            if (work.block[block].z_far < 0.0f) continue;
            paint_block(&bvh, &surfaces, &rays, &work, block, pixel, &easel);
            global float *colours = easel.colours.base;
#if PLANES
            for (int ray = 0; ray < 3 * BLOCK_RAYS; ray += LANES)
                VSTORE(clamp(VLOAD(colours + ray), (vf)(0.0f), (vf)(1.0f)), colours + ray);
#endif
            const int element = work.element[block / ELEMENT_BLOCKS];
            const int2 where = block_position(&work, block);
#if PLANES
            const int packed = places[element].w;
#if VIEWS
            add_view_to_planes(&planes, packed & 0xffff, packed >> 16, region.s6, where.x, where.y, colours);
#else
            add_to_planes(&planes, packed & 0xffff, packed >> 16, where.x / BLOCK, where.y / BLOCK, columns, rows, colours,
                          (global uint *)easel.spare, table);
#endif
#endif
#if FRAMES
            write_frames(&out, element, where.x, where.y, columns, rows, colours);
#endif
        }
    }
}
