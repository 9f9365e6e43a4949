// Where a lens from a file takes the rays of a view: nodes over the picture, see NODE on the host.
#pragma once
#include "boxes.cl"

#if LENS
#define NODES_PER_PIXEL(s) ((LENS_NODES - 1) / (LENS_EXTENT * max((s)->width, (s)->height)))

// The row of nodes next to a row of the picture.
inline global const float16 *row_at(const SlicingArguments *s, global const float16 *nodes, float y)
{
    const float row = rint((y - s->axis_y) * NODES_PER_PIXEL(s) + 0.5f * (LENS_NODES - 1));
    return nodes + (int)clamp(row, 0.0f, LENS_NODES - 1.0f) * LENS_NODES;
}

// Interpolate the nodes at a place of the picture; beyond the last nodes, their values hold.
inline float16 node_at(const SlicingArguments *s, global const float16 *nodes, float x, float y)
{
    const float last = LENS_NODES - 1;
    const float per_pixel = NODES_PER_PIXEL(s);
    const float u = clamp((x - s->axis_x) * per_pixel + 0.5f * last, 0.0f, last);
    const float v = clamp((y - s->axis_y) * per_pixel + 0.5f * last, 0.0f, last);
    const int i = min((int)u, LENS_NODES - 2), j = min((int)v, LENS_NODES - 2);
    global const float16 *row = nodes + j * LENS_NODES + i, *next = row + LENS_NODES;
    const float16 above = row[0] + (row[1] - row[0]) * (u - i);
    const float16 below = next[0] + (next[1] - next[0]) * (u - i);
    return above + (below - above) * (v - j);
}

// The boxes of sixteen rays of a row that a perfect lens takes to columns `x` and row `y`.  Places
// are linear between the first of these rays and the last; sides of boxes are the middle's.
// `apart`: the pixels between their colours.
inline Spread land(const SlicingArguments *s, global const float16 *nodes, const PlacedView *v,
                   float16 x, float y, float16 moves, float least, float16 *apart)
{
    const float16 first = node_at(s, nodes, x.s0, y);
    const float16 change = (node_at(s, nodes, x.sf, y) - first) * (1.0f / (ABREAST - 1));
    const float16 along = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    const float16 middle = first + change * (0.5f * (ABREAST - 1));
#define PART(k) fma(along, change.s##k, first.s##k)
    *apart = PART(d);
    const float16 wide = v->side_x * middle.s4 * (moves + middle.s6);
    const float16 tall = v->side_y * middle.s5 * (moves + middle.s7);
    return (Spread){.x = x + PART(0) + (v->offset_x + PART(2)) * moves,
                    .y = y + PART(1) + (v->offset_y + PART(3)) * moves,
                    .half_x = 0.5f * max(sqrt(wide * wide + middle.s8), least),
                    .half_y = 0.5f * max(sqrt(tall * tall + middle.s9), least),
                    .weight = v->weight * PART(a)};
}
#endif
