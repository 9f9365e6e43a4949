// Sensor planes while they are formed: exact integer sums, and how the blocks of a view are added.
//
// Radiance is held in fixed point (20 bits below the binary point): sums are integers, exact, and the
// same in whatever order blocks are added.
#ifndef LFCORE_PLANES_CL
#define LFCORE_PLANES_CL
#include "bundle.cl"

#define FIXED_ONE 1048576.0f

typedef struct {
    int planes;                    // number of planes, sorted by mask
    int blocks;                    // blocks along a side of the lens grid
    int left, top, width, height;  // region of the accumulators in plane pixels
    int size;                      // side M of a plane
    global const int4 *plane;      // (planes,) mask, runs offset, runs per pixel (0: the same for all), 0
    global const int *runs;        // where rays fall: see beam_planes.cl and add_view_to_planes
    global const uchar *masks;     // (masks, N, N) 255 where open; for beams, N in whole beams
    global const uchar *kinds;     // (masks, blocks, blocks) 0 closed, 1 partly, 2 wholly open
    global ulong4 *sums;           // (planes, height, width) of this worker: red, green, blue, 0
} Planes;

#if LANES == 16
// Add a row of sixteen pixels to sixteen neighbours from `to` on.
inline void add_row(global const float *c, global ulong *to)
{
    const uint16 r = TO_VU(fma(VLOAD(c), (vf)(FIXED_ONE), (vf)(0.5f))), g = TO_VU(fma(VLOAD(c + BLOCK_RAYS), (vf)(FIXED_ONE), (vf)(0.5f)));
    const uint16 b = TO_VU(fma(VLOAD(c + 2 * BLOCK_RAYS), (vf)(FIXED_ONE), (vf)(0.5f)));
#define ADD_TWO(k, i, j) vstore8(vload8(k, to) + convert_ulong8((uint8)(r.i, g.i, b.i, 0, r.j, g.j, b.j, 0)), k, to);
    ADD_TWO(0, s0, s1)
    ADD_TWO(1, s2, s3)
    ADD_TWO(2, s4, s5)
    ADD_TWO(3, s6, s7)
    ADD_TWO(4, s8, s9)
    ADD_TWO(5, sa, sb)
    ADD_TWO(6, sc, sd)
    ADD_TWO(7, se, sf)
#undef ADD_TWO
}
#endif

// Add a block of pixels of one view (lens sample bi, bj), whose first pixel is (column, row): `runs`
// holds the target of every pixel column for each lens column, rows alike.
inline void add_view_to_planes(const Planes *p, int bi, int bj, int views, int column, int row, global const float *colours)
{
    for (int plane = 0; plane < p->planes; ++plane) {
        const int4 info = p->plane[plane];
        if (!p->masks[((ulong)info.x * views + bj) * views + bi]) continue;
        global const int *across = p->runs + info.y + bi * p->size + column, *down = p->runs + info.y + bj * p->size + row;
        const int columns = min(BLOCK, p->size - column), rows = min(BLOCK, p->size - row);
        global ulong4 *sums = p->sums + (ulong)plane * p->width * p->height;
        int whole = 0;  // are the targets sixteen neighbours within the picture, as they are for a mere shift?
#if LANES == 16
        whole = columns == BLOCK && across[0] >= 0 && across[BLOCK - 1] < p->size
                && all(vload16(0, across) == across[0] + (int16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15));
#endif
        for (int y = 0; y < rows; ++y) {
            if (down[y] < 0 || down[y] >= p->size) continue;
            global ulong4 *line = sums + (ulong)down[y] * p->width;
            global const float *c = colours + y * BLOCK;
#if LANES == 16
            if (whole) {
                add_row(c, (global ulong *)(line + across[0]));
                continue;
            }
#endif
            for (int x = 0; x < columns; ++x) {
                if (across[x] < 0 || across[x] >= p->size) continue;
                const float4 colour = (float4)(c[x], c[BLOCK_RAYS + x], c[2 * BLOCK_RAYS + x], 0.0f);
                line[across[x]] += convert_ulong4(fma(colour, FIXED_ONE, (float4)(0.5f, 0.5f, 0.5f, 0.0f)));
            }
        }
    }
}

#endif
