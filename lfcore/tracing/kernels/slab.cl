// The whole of Algorithms 1 and 3 for one chunk of a tile: see, shade, cast shadows, form sensor planes
// (PLANES) and write encoder-ready frames (FRAMES).
#include "paint.cl"
#include "beam_planes.cl"
#include "frames.cl"

#define COLOURS (3 * BLOCK_RAYS)  // of one tile of a beam
#define SCRATCH_WORDS (EASEL_WORDS + BEAM_TILES * COLOURS + PLANES * PREFIX_WORDS)

kernel void scratch_words(global int *words) { *words = SCRATCH_WORDS; }

#if OUTER > 1
// Clamp a block's colours to what is stored, and put them where its tiles are.
inline void hand_over(global const float *from, int block, global float *painted)
{
    const int x = block % SIDE * INNER, y = block / SIDE * INNER;
    const int within = y / BLOCK * TILE_SIDE + x / BLOCK, corner = y % BLOCK * BLOCK + x % BLOCK;
    for (int at = 0; at < BLOCK_RAYS; at += INNER) {
        const int element = at / BLOCK / INNER * OUTER + at % BLOCK / INNER;
        global float *to = painted + (element * ELEMENT_TILES + within) * COLOURS + corner + at / BLOCK % INNER * BLOCK;
        for (int channel = 0; channel < 3; ++channel)
            JOIN(vstore, INNER)(clamp(JOIN(vload, INNER)(0, from + channel * BLOCK_RAYS + at), 0.0f, 1.0f), 0, to + channel * BLOCK_RAYS);
    }
}
#endif

// Linear colours of every tile of a beam: (BEAM_TILES, 3, BLOCK_RAYS), within [0, 1] for planes.
inline void paint_beam(const Bvh *bvh, const Surfaces *s, const Rays *rays, BeamWork *work, float pixel, Easel *easel,
                       global float *colours)
{
    see_beam(bvh, s, rays, work, easel);
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        if (work->block[block].z_far < 0.0f) continue;
#if OUTER > 1
        paint_block(bvh, s, rays, work, block, pixel, easel);
        hand_over(easel->colours.base, block, colours);
#else
        easel->colours.base = colours + block * COLOURS;
        paint_block(bvh, s, rays, work, block, pixel, easel);
#if PLANES
        for (int at = 0; at < COLOURS; at += LANES)
            VSTORE(clamp(VLOAD(easel->colours.base + at), (vf)(0.0f), (vf)(1.0f)), easel->colours.base + at);
#endif
#endif
    }
}

// What is made of a painted beam tile by tile: planes of views, and frames, in which `colours` end.
inline void write_tiles(const Planes *planes, const Frames *out, const Rays *rays, const BeamWork *work, int views, global float *colours)
{
    for (int tile = 0; tile < BEAM_TILES; ++tile, colours += COLOURS) {
        const int element = tile_element(work, tile);
        if (element < 0) continue;
        const int2 where = tile_position(work, tile);
#if PLANES && VIEWS
        const int packed = out->places[element].w;
        add_view_to_planes(planes, packed & 0xffff, packed >> 16, views, where.x, where.y, colours);
#endif
#if FRAMES
        write_frames(out, element, where.x, where.y, rays->columns, rays->rows, colours);
#endif
    }
}

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void trace_slab(BVH_PARAMETERS,
                SURFACES_PARAMETERS,
                RAYS_PARAMETERS,
                const float pixel,                      // tangent between neighbouring pixels
                global int *restrict next,
                global uint *restrict scratch,          // (workers, SCRATCH_WORDS)
                global const int4 *restrict places,     // (E,) frame, x0, y0, pixel u + (v << 16)
                global sample *restrict frames,
                const int frame_width,
                const int frame_height,
                const int tall,                         // beams in a strip
                global int2 *restrict windows,          // (workers, planes), empty
                global uint *restrict strips,           // (workers, planes, ring, 3, BEAM_COLUMNS), zero
                const int ring,
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
    global float *painted = (global float *)(memory + EASEL_WORDS);
    global uint *prefix = memory + EASEL_WORDS + BEAM_TILES * COLOURS;
#if PLANES && !VIEWS
    const Strip strip = {windows + get_global_id(0) * n_planes,
                         strips + get_global_id(0) * (ulong)n_planes * ring * PREFIX_PITCH, ring};
#endif
    BeamWork work;
    const int squares = rays.beams_across * rays.beams_down, n_items = n_beams / tall;
    for (int item = atomic_inc(next); item < n_items; item = atomic_inc(next)) {
        int u = 0;
        for (int k = 0; k < tall; ++k) {
            start_beam(&rays, (item / squares * tall + k) * squares + item % squares, &work);
            const int first = first_element(&work);
            if (first < 0) continue;
#if PLANES && !FRAMES && !VIEWS
            drop_closed_blocks(&planes, &work);
#endif
            paint_beam(&bvh, &surfaces, &rays, &work, pixel, &easel, painted);
#if PLANES && !VIEWS
            u = (places[first].w & 0xffff) / GROUP * GROUP;
            add_to_strip(&planes, &work, (places[first].w >> 16) / GROUP * GROUP, painted, prefix, &strip);
#endif
            write_tiles(&planes, &out, &rays, &work, region.s6, painted);
        }
#if PLANES && !VIEWS
        finish_strip(&planes, u, item % rays.beams_across, &strip);
#endif
    }
}
