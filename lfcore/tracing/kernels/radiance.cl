// Linear radiance of bundles, as floats: no planes, no frames, nothing clamped.
//
// Element e is tile (e / across, e % across) of one image; with one tile across, elements follow each other.
#include "paint.cl"

kernel void scratch_words(global int *words) { *words = EASEL_WORDS; }

#define ADD 1     // to what is there already
#define STREAM 2  // past the caches

#if LANES == BLOCK
#define LINE 64   // bytes of a row of lanes, and what stores past the caches must be aligned to
#ifdef __has_builtin
#if __has_builtin(__builtin_nontemporal_store)
#define VSTREAM(x, p) __builtin_nontemporal_store(x, (global vf *)(p))
#endif
#endif
#ifndef VSTREAM
#define VSTREAM VSTORE
#endif

// A row of a block, of which all is inside the inner grid, as 16 times r g b.
inline void write_row(vf r, vf g, vf b, int mode, global float *to)
{
    const vu rg0 = (vu)(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5);
    const vu b0 = (vu)(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15);
    const vu rg1 = (vu)(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26);
    const vu b1 = (vu)(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15);
    const vu rg2 = (vu)(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0);
    const vu b2 = (vu)(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31);
    vf first = shuffle2(shuffle2(r, g, rg0), b, b0);
    vf second = shuffle2(shuffle2(r, g, rg1), b, b1);
    vf third = shuffle2(shuffle2(r, g, rg2), b, b2);
    if (mode & ADD) {
        first += VLOAD(to);
        second += VLOAD(to + LANES);
        third += VLOAD(to + 2 * LANES);
    }
    if ((mode & STREAM) && (ulong)to % LINE == 0) {
        VSTREAM(first, to);
        VSTREAM(second, to + LANES);
        VSTREAM(third, to + 2 * LANES);
    } else {
        VSTORE(first, to);
        VSTORE(second, to + LANES);
        VSTORE(third, to + 2 * LANES);
    }
}
#endif

// Write `wide` x `high` rays of a block, whose first is at `to`, `pitch` floats a row of the image.
inline void write_block(global const float *colours, int wide, int high, int mode, global float *to, ulong pitch)
{
    for (int y = 0; y < high; ++y, to += pitch) {
        global const float *c = colours + y * BLOCK;
#if LANES == BLOCK
        if (wide == BLOCK) {
            write_row(VLOAD(c), VLOAD(c + BLOCK_RAYS), VLOAD(c + 2 * BLOCK_RAYS), mode, to);
            continue;
        }
#endif
        for (int x = 0; x < wide; ++x) {
            const float3 colour = (float3)(c[x], c[x + BLOCK_RAYS], c[x + 2 * BLOCK_RAYS]);
            vstore3(mode & ADD ? vload3(x, to) + colour : colour, x, to);
        }
    }
}

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void trace_radiance(BVH_PARAMETERS,
                    SURFACES_PARAMETERS,
                    RAYS_PARAMETERS,
                    const float pixel,
                    global int *restrict next,
                    global uint *restrict scratch,    // (workers, EASEL_WORDS)
                    const int across,
                    const int mode,                   // ADD, STREAM
                    global float *restrict radiance)  // (E / across * rows, across * columns, 3)
{
    const Bvh bvh = MAKE_BVH;
    const Surfaces surfaces = MAKE_SURFACES;
    const Rays rays = MAKE_RAYS;
    Easel easel = make_easel(scratch + get_global_id(0) * (ulong)EASEL_WORDS);
    const ulong pitch = 3 * (ulong)across * columns;
    BeamWork work;
    for (int beam = atomic_inc(next); beam < n_beams; beam = atomic_inc(next)) {
        start_beam(&rays, beam, &work);
        see_beam(&bvh, &surfaces, &rays, &work, &easel);
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            if (work.block[block].z_far < 0.0f) continue;
            paint_block(&bvh, &surfaces, &rays, &work, block, pixel, &easel);
            const int2 where = block_position(&work, block);
            const int element = work.element[block / ELEMENT_BLOCKS];
            const ulong row = (ulong)(element / across) * rows + where.y;
            const ulong column = (ulong)(element % across) * columns + where.x;
            write_block(easel.colours.base, min(BLOCK, columns - where.x), min(BLOCK, rows - where.y), mode,
                        radiance + row * pitch + 3 * column, pitch);
        }
    }
}
