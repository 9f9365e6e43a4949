// Boxes added to the sums of a strip.  A ray's light in a pixel is rounded by the ray's own dither,
// so that the rounding errors of many rays cancel.
#pragma once
#include "boxes.cl"

// Add to two pixels of a row.
inline void add_two(global sum4 *at, sum8 light)
{
    global sum *to = (global sum *)at;
    vstore8(vload8(0, to) + light, 0, to);
}

// A box of at most two pixels along each axis, inside the strip.
inline void add_four(const Strip *s, const Boxes *b, int k, global sum4 *to, float4 colour)
{
    const float8 light = (float8)(colour, colour);
    const float8 along = (float8)((float4)(b->along[0][k]), (float4)(b->along[1][k]));
    global sum4 *row = to + b->y[0][k] + b->x[0][k];
    add_two(row, TO_SUM(8, fma(light, along * b->down[0][k], b->dither[k])));
    add_two(row + (s->width + 1), TO_SUM(8, fma(light, along * b->down[1][k], b->dither[k])));
}

// Differences along x of the head, a whole pixel and the tail.
inline sum16 edges_of(float16 light, float16 part, float dither)
{
    const sum16 sums = TO_SUM(16, fma(light, part, dither));
    return sums - (sum16)((sum4)(0), sums.lo, sums.s89ab);
}

// Differences of a box along both axes.  Along x they are the head in the first column, a whole
// pixel less the head behind it, the tail less a whole pixel in the last column, and minus the tail
// behind it; rows likewise.  Nine products are rounded, and the sixteen numbers are their
// differences: they cancel behind the box, and each pixel of the box has one of the nine.
inline void add_edges(const Strip *s, const Boxes *b, int k, global sum4 *to, float4 colour)
{
    const float16 light = (float16)(colour, colour, colour, colour);
    const float16 along = (float16)((float4)(b->along[0][k]), (float4)(b->along[2][k]),
                                    (float4)(b->along[1][k]), (float4)(0.0f));
    const sum16 top = edges_of(light, along * b->down[0][k], b->dither[k]);
    const sum16 whole = edges_of(light, along * b->down[2][k], b->dither[k]);
    const sum16 low = edges_of(light, along * b->down[1][k], b->dither[k]);
    const sum16 rows[4] = {top, whole - top, low - whole, -low};
    for (int j = 0; j < 4; ++j) {
        global sum4 *row = to + b->y[j / 2][k] + j % 2 * pitch_of(s, b->layer[k]);
        add_two(row + b->x[0][k], rows[j].lo);
        add_two(row + b->x[1][k], rows[j].hi);
    }
}

// The part of [low, high] in a pixel, in 1 / STEPS.
inline int overlap(int low, int high, int pixel)
{
    return min(high, (pixel + 1) * STEPS) - max(low, pixel * STEPS);
}

inline void add_few(const Strip *s, const Boxes *b, int k, global sum4 *to, float4 colour)
{
    const int left = b->box[0][k], top = b->box[1][k], right = b->box[2][k], bottom = b->box[3][k];
    const int x0 = max(0, floor_pixel(left)), x1 = min(s->width - 1, floor_pixel(right - 1));
    const int y0 = max(s->top, floor_pixel(top));
    const int y1 = min(s->top + s->rows - 1, floor_pixel(bottom - 1));
    for (int y = y0; y <= y1; ++y) {
        const int down = overlap(top, bottom, y);
        global sum4 *at = to + (ulong)(y - s->top) * (s->width + 1);
        for (int x = x0; x <= x1; ++x) {
            const float part = down * overlap(left, right, x);
            at[x] += TO_SUM(4, fma(colour, part, b->dither[k]));
        }
    }
}

// Add the boxes of a kind; returns the bits of their layers.
inline int add_kind(const Strip *s, const Boxes *b, int kind)
{
    int used = 0;
    int list[ABREAST], count = 0;
    for (int n = 0; n < ABREAST; ++n) {
        const int k = n * 4 % ABREAST + n / 4;  // not in order: neighbours share pixels
        list[count] = k;
        count += b->kind[k] == kind;
    }
    for (int at = 0; at < count; ++at) {
        const int k = list[at];
        global sum4 *to = s->sums[b->layer[k]];
        used |= 1 << b->layer[k];
        const float4 colour = vload4(0, b->colour[k]);
        if (kind == FEW) add_few(s, b, k, to, colour);
        else if (kind == FOUR) add_four(s, b, k, to, colour);
        else add_edges(s, b, k, to, colour);
    }
    return used;
}
