// Rays of views, a row of sixteen at a time, and sums over squares of rays.
//
// STORED: rays of a file, with light in fixed point (LIGHT_ONE is 1) and depth codes of type CODE.
#pragma once
#include "colours.cl"

#if STORED
typedef uint light_t;
typedef CODE depth_t;
#define DIOPTRES(code) dioptres[code]
#define RADIANCE(light) ((light) / (float)(LIGHT_ONE))
#else
typedef float light_t, depth_t;
#define DIOPTRES(depth) (1.0f / (depth))
#define RADIANCE(light) (light)
#endif

// A group is the rays that are added together, ABREAST squares: a patch, or squares of 2 x 2.
#define GROUP_ROWS (FOURS ? PATCH_ROWS : 2)
#define GROUP_COLUMNS (GROUP_ROWS * ABREAST)

// Rows of one view; steps to the next colour, pixel and row of its light.
typedef struct {
    const SlicingArguments *numbers;
    global const light_t *light;
    global const depth_t *depth;
    global const float *dioptres;
    ulong channel, pixel, row;
    int columns, rows, groups;  // groups of a row
} View;

inline View view_of(global const light_t *light, global const depth_t *depth,
                    global const float *dioptres, const SlicingArguments *n, int view)
{
    const ulong count = (ulong)n->rows * n->columns, at = view * count, pixel = STORED ? 1 : 3;
    return (View){.numbers = n, .light = light + 3 * at, .depth = depth + at,
                  .dioptres = dioptres, .channel = STORED ? count : 1, .pixel = pixel,
                  .row = pixel * n->columns, .columns = n->columns, .rows = n->rows,
                  .groups = (n->columns + GROUP_COLUMNS - 1) / GROUP_COLUMNS};
}

// ABREAST rays of a row, or squares of rays: sums of their colours and dioptres, and the least and
// the most dioptres.
typedef struct { float16 sums[4], low, high; } RaySums;

// Rays from column `start` of row `v` on; beyond the last row or column, its rays are repeated.
inline RaySums read_row(const View *of, int v, int start)
{
    v = min(v, of->rows - 1);
    start = min(start, of->columns - 1);
    global const light_t *light = of->light + (ulong)v * of->row + start * of->pixel;
    global const depth_t *depth = of->depth + (ulong)v * of->columns + start;
    global const float *dioptres = of->dioptres;
    RaySums r;
    if (start + ABREAST <= of->columns) {
#if STORED
#define TWO(k) DIOPTRES(depth[k]), DIOPTRES(depth[k + 1])
#define EIGHT(k) TWO(k), TWO(k + 2), TWO(k + 4), TWO(k + 6)
        r.low = (float16)(EIGHT(0), EIGHT(8));
        for (int c = 0; c < 3; ++c)
            r.sums[c] = convert_float16(vload16(0, light + c * of->channel));
#else
        r.low = DIOPTRES(vload16(0, depth));
        split_colours(light, r.sums);
#endif
    } else {
        float inverse[ABREAST], colours[3][ABREAST];
        for (int k = 0; k < ABREAST; ++k) {
            const int at = min(k, of->columns - 1 - start);
            inverse[k] = DIOPTRES(depth[at]);
            for (int c = 0; c < 3; ++c) colours[c][k] = light[at * of->pixel + c * of->channel];
        }
        r.low = vload16(0, inverse);
        for (int c = 0; c < 3; ++c) r.sums[c] = vload16(0, colours[c]);
    }
    const float brightest = of->numbers->brightest, white = of->numbers->white;
    for (int c = 0; c < 3; ++c) r.sums[c] = clamp(RADIANCE(r.sums[c]), 0.0f, brightest) * white;
    r.sums[3] = r.high = r.low;
    return r;
}

// Join pieces a and b of a row, and c and d of the next row, to squares of 2 x 2.
inline RaySums join(RaySums a, RaySums b, RaySums c, RaySums d)
{
#define PLUS(x, y) ((x) + (y))
#define PAIRS(of, x, y) of((float16)((x).even, (y).even), (float16)((x).odd, (y).odd))
    for (int k = 0; k < 4; ++k)
        a.sums[k] = PAIRS(PLUS, a.sums[k] + c.sums[k], b.sums[k] + d.sums[k]);
    a.low = PAIRS(min, min(a.low, c.low), min(b.low, d.low));
    a.high = PAIRS(max, max(a.high, c.high), max(b.high, d.high));
    return a;
}

// Squares of 2 x 2 rays, the first at column `start` of row `v`.
inline RaySums read_squares(const View *of, int v, int start)
{
    return join(read_row(of, v, start), read_row(of, v, start + ABREAST),
                read_row(of, v + 1, start), read_row(of, v + 1, start + ABREAST));
}

#if FOURS
// The squares of 4 x 4 rays of a patch.
inline RaySums read_fours(const View *of, int v, int start)
{
    const int middle = start + PATCH_COLUMNS / 2;
    return join(read_squares(of, v, start), read_squares(of, v, middle),
                read_squares(of, v + 2, start), read_squares(of, v + 2, middle));
}

inline void store_squares(const RaySums *r, global Squares *to)
{
    for (int k = 0; k < 4; ++k) vstore16(r->sums[k], 0, to->sums[k]);
    vstore16(r->low, 0, to->low);
    vstore16(r->high, 0, to->high);
}

inline RaySums load_squares(global const Squares *from)
{
    RaySums r;
    for (int k = 0; k < 4; ++k) r.sums[k] = vload16(0, from->sums[k]);
    r.low = vload16(0, from->low);
    r.high = vload16(0, from->high);
    return r;
}
#endif
