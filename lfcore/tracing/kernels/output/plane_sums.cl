// Sensor planes while they are formed: exact integer sums, and how blocks of a view are added.
//
// Radiance is held in fixed point: sums are integers, exact, and the same in whatever order blocks
// are added.  It reaches STOPS above white.
#pragma once
#include "lanes.cl"

// Radiance 1: a column of a packet adds 64 rays, which 32 bits hold.
#define COARSE (STOPS > SPARE_STOPS)
#ifndef ONE_OF_SUMS
#define ONE_OF_SUMS (FIXED_ONE / (COARSE ? 1 << (STOPS - SPARE_STOPS) : 1))
#endif
// Added before fractions are dropped: one half; in coarse sums unlike numbers with that mean, so
// that the fractions of equal rays count.
#define SPREAD_HALVES (float16)(1, 17, 9, 25, 5, 21, 13, 29, 3, 19, 11, 27, 7, 23, 15, 31) / 32.0f
#define HALVES (COARSE ? SPREAD_HALVES : (float16)(0.5f))

typedef struct {
    const SensorPlaneArguments *numbers;
    global const SensorPlane *plane;  // (planes,)
    global const int *runs;     // where rays fall: Runs of packets, or targets of views
    global const uchar *masks;  // (masks, N, N) 255 where open; for packets, N in whole packets
    global const uchar *kinds;  // (masks, blocks, blocks) 0 closed, 1 partly, 2 wholly open
    global ulong4 *sums;        // (planes, height, width) of this worker: red, green, blue, 0
} SensorPlanes;

inline global ulong4 *sums_of(const SensorPlanes *p, int plane)
{
    return p->sums + (ulong)plane * p->numbers->width * p->numbers->height;
}

// Add a block of pixels of one view, of lens sample `view`, whose first pixel of those that it has
// is `at`: `runs` holds the target of every pixel column for each lens column, rows alike.
inline void add_view(const SensorPlanes *p, int2 view, int2 at, global const float *colours)
{
    const SensorPlaneArguments *n = p->numbers;
    const int columns = min(BLOCK, n->columns - at.x), rows = min(BLOCK, n->rows - at.y);
    for (int plane = 0; plane < n->planes; ++plane) {
        const SensorPlane info = p->plane[plane];
        const float part = COARSE ? (((view.x + 4 * view.y) & 15) + 0.5f) / 16.0f : 0.5f;
        const float4 half_unit = (float4)(part, part, part, 0.0f);
        if (!p->masks[((ulong)info.mask * n->views + view.y) * n->views + view.x]) continue;
        global const int *columns_to = p->runs + info.runs + view.x * n->size + n->column + at.x;
        global const int *rows_to = p->runs + info.runs + view.y * n->size + n->row + at.y;
        for (int y = 0; y < rows; ++y) {
            const int line_y = rows_to[y] - n->top;
            if (line_y < 0 || line_y >= n->height) continue;
            global ulong4 *line = sums_of(p, plane) + (ulong)line_y * n->width;
            global const float *c = colours + y * BLOCK;
            for (int x = 0; x < columns; ++x) {
                const int line_x = columns_to[x] - n->left;
                if (line_x < 0 || line_x >= n->width) continue;
                const float4 colour = (float4)(c[x], c[BLOCK_RAYS + x], c[2 * BLOCK_RAYS + x],
                                               0.0f);
                const int4 fixed = convert_int4(fma(colour, ONE_OF_SUMS, half_unit));
                line[line_x] += convert_ulong4(as_uint4(fixed));
            }
        }
    }
}
