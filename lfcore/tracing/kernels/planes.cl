// Sensor planes from blocks of lens samples: exact sums by a summed-area table of the block.
//
// The pixel a ray falls on is separable and monotone in the lens sample, so a block falls into a small
// grid of bins.  With a summed-area table of the block every further plane costs four look-ups a bin.
// Radiance is held in fixed point (20 bits below the binary point): sums are integers, exact, and the
// same in whatever order blocks are added.
#ifndef LFCORE_PLANES_CL
#define LFCORE_PLANES_CL
#include "bundle.cl"

#define FIXED_ONE 1048576.0f
#define TABLE_PITCH 17
#define TABLE_WORDS (17 * TABLE_PITCH * 4)
#define RUN 34  // ints: count, 17 starts, 16 offsets

typedef struct {
    int planes;                    // number of planes, sorted by mask
    int blocks;                    // blocks along a side of the lens grid
    int left, top, width, height;  // region of the accumulators in plane pixels
    int size;                      // side M of a plane
    global const int4 *plane;      // (planes,) mask, runs offset, runs per pixel (0: the same for all), 0
    global const int *runs;        // (..., RUN) per position and block: columns of equal target pixel
    global const uchar *masks;     // (masks, N, N) 255 where open
    global const uchar *kinds;     // (masks, blocks, blocks) 0 closed, 1 partly, 2 wholly open
    global ulong4 *sums;           // (planes, height, width) of this worker: red, green, blue, 0
} Planes;

// (17, 17) exclusive prefix sums of a block of fixed-point colours, with the mask (or none) applied.
inline void make_table(global const uint *fixed, global const uchar *mask, int pitch, int columns, int rows, global uint4 *table)
{
    for (int row = 0; row < BLOCK; ++row) {
        global uint4 *above = table + row * TABLE_PITCH, *here = above + TABLE_PITCH;
        global const uint *from = fixed + row * BLOCK;
        uint4 sum = 0;
        for (int k = 0; k < BLOCK; ++k) {
            const uint4 value = (uint4)(from[k], from[BLOCK_RAYS + k], from[2 * BLOCK_RAYS + k], 0);
            if (!mask || (row < rows && k < columns && mask[row * pitch + k])) sum += value;
            here[k + 1] = sum + above[k + 1];
        }
    }
}

inline void add_bins(const Planes *p, int plane, global const int *across, global const int *down, int u, int v, global const uint4 *table)
{
    global ulong4 *sums = p->sums + (ulong)plane * p->width * p->height;
    for (int b = 0; b < down[0]; ++b) {
        const int y = v + down[18 + b];
        if (y < 0 || y >= p->size) continue;
        global const uint4 *top = table + down[1 + b] * TABLE_PITCH, *bottom = table + down[2 + b] * TABLE_PITCH;
        global ulong4 *line = sums + (y - p->top) * p->width - p->left;
        uint4 before = bottom[0] - top[0];
        for (int a = 0; a < across[0]; ++a) {
            const int x = u + across[18 + a], right = across[2 + a];
            const uint4 here = bottom[right] - top[right];
            if (x >= 0 && x < p->size) line[x] += convert_ulong4(here - before);
            before = here;
        }
    }
}

// Add a block of linear colours (3, BLOCK_RAYS) of pixel (u, v): block column bi and row bj of the lens
// grid of `columns` x `rows` samples.  `fixed` (3, BLOCK_RAYS) and `words` (TABLE_WORDS) are scratch.
inline void add_to_planes(const Planes *p, int u, int v, int bi, int bj, int columns, int rows, global const float *colours,
                          global uint *fixed, global uint *words)
{
    global uint4 *table = (global uint4 *)words;
    for (int at = 0; at < 3 * BLOCK_RAYS; at += LANES) VSTORE(TO_VU(fma(VLOAD(colours + at), (vf)(FIXED_ONE), (vf)(0.5f))), fixed + at);
    for (int k = 0; k < 17; ++k) table[k] = table[k * TABLE_PITCH] = 0;
    int have = -2;  // which mask the table is of; -1: none
    for (int plane = 0; plane < p->planes; ++plane) {
        const int4 info = p->plane[plane];
        const int kind = p->kinds[(info.x * p->blocks + bj) * p->blocks + bi], want = kind == 2 ? -1 : info.x;
        if (!kind) continue;
        if (want != have) {
            make_table(fixed, want < 0 ? 0 : p->masks + ((ulong)info.x * rows + bj * BLOCK) * columns + bi * BLOCK, columns,
                       columns - bi * BLOCK, rows - bj * BLOCK, table);
            have = want;
        }
        global const int *runs = p->runs + info.y;
        add_bins(p, plane, runs + (u * info.z + bi) * RUN, runs + (v * info.z + bj) * RUN, u, v, table);
    }
}

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
