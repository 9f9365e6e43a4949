// The boxes over which rays are spread on a plane: edges, layers and weights of sixteen at a time.
#pragma once
#include "sums.cl"

// How a box is added: not at all; as at most two pixels along each axis; pixel by pixel; as
// differences.
enum { OUTSIDE, FOUR, FEW, EDGES };
typedef struct {
    int kind[ABREAST], layer[ABREAST];
    int box[4][ABREAST];       // left, top, right and bottom edge, in 1 / STEPS pixel
    int x[2][ABREAST];         // the first and the last column
    int y[2][ABREAST];         // rows likewise, as offsets
    float along[3][ABREAST];   // the box's parts in its columns, see parts_along
    float down[3][ABREAST];    // rows likewise
    float colour[ABREAST][4];  // light and weight per part of a pixel
    float dither[ABREAST];
} Boxes;

inline int floor_pixel(int edge) { return edge >> STEP_BITS; }
#define FLOOR_PIXELS(edges) ((edges) >> STEP_BITS)

// The layers of sweeps in pixels, the nearest first.
inline int16 layer_of(float16 sweep, const float *bounds)
{
    int16 beyond = 0;  // a true comparison is -1
    for (int k = 0; k < N_BOUNDS; ++k) beyond -= fabs(sweep) >= bounds[k];
    return N_BOUNDS + select(beyond, -beyond, sweep < 0.0f);
}

// Round to steps; positions far outside are clamped to the range of integers.
inline int16 to_steps(const Strip *s, float16 place)
{
    return convert_int16(rint(clamp(place, -s->far, s->far + s->far) * (float)STEPS));
}

// One axis of boxes: their first pixel and the last, counted from `first`; and the box's parts in
// the first, the last and the pixels between; or in the first two if it is not added by
// `differences`.  A box beyond an end is cut there.  If the first is the last, all three are its
// part: sums of different products round differently.
inline void parts_along(int16 low, int16 high, int16 first, int16 count, int16 differences,
                        int16 at[2], int16 part[3])
{
    const int16 a = FLOOR_PIXELS(low) - first, b = FLOOR_PIXELS(high - 1) - first;
    const int16 head = STEPS - (low & (STEPS - 1)), left = min(head, high - low);
    at[0] = max(a, 0);
    at[1] = min(b, count - 1);
    part[0] = select(left, select(head, STEPS, a < 0), differences);
    part[1] = select(high - low - left,
                     select(high - (first + b) * STEPS, STEPS, b >= count), differences);
    part[2] = STEPS;
    const int16 one = differences & at[0] == at[1], all = part[0] + part[1] - STEPS;
    for (int k = 0; k < 3; ++k) part[k] = select(part[k], all, one);
}

// COARSE: a pixel of a view is larger than one of the picture.  If a box's side is no whole number
// of view pixels, it overlaps its neighbours unevenly, which is visible as a pattern where few
// views see a surface.  So a ray has two boxes, with the whole numbers below and above as sides:
// `part` selects one.  Grows the halves of a side and scales the weights.
inline void make_even(float step, int part, float16 *half_x, float16 *half_y, float16 *weight)
{
    const int even = step > COARSE_PX;
    const float16 side = 2.0f * max(*half_x, *half_y) / step;
    const float16 whole = max(side, 1.0f), below = floor(whole);
    const float16 grown = even ? (below + (float)part) / side : (float16)(1.0f);
    *weight *= even ? fabs((float)(1 - part) - (whole - below)) : (float16)(1 - part);
    *half_x *= grown;
    *half_y *= grown;
}

// The boxes about x and y of rays whose light moves by pixels per metre of the lens; returns their
// weights.
inline float16 find_boxes(const Strip *s, const FocusPlane *p, const PlacedView *view,
                          float16 moves, float16 x, float16 y, float least, int part, int16 wanted,
                          Boxes *b)
{
    float16 half_x = 0.5f * max(fabs(moves) * view->side_x, least);
    float16 half_y = 0.5f * max(fabs(moves) * view->side_y, least), weight = view->weight;
#if COARSE
    make_even(p->step, part, &half_x, &half_y, &weight);
#endif
    const int16 layer = layer_of(moves * p->pitch, p->bounds), halved = IS_HALF(layer);
    const float16 pixel = select((float16)(1.0f), (float16)(0.5f), halved);
    const int16 left = to_steps(s, (x - half_x) * pixel), top = to_steps(s, (y - half_y) * pixel);
    const int16 right = to_steps(s, (x + half_x) * pixel);
    const int16 bottom = to_steps(s, (y + half_y) * pixel);
    const int16 wide = right - left, tall = bottom - top;
    const int16 rows = select((int16)(s->rows), (int16)(pixels_of(s->rows, 1)), halved);
    const int16 width = select((int16)(s->width), (int16)(pixels_of(s->width, 1)), halved);
    // The first pixels of the strip, and edges of its area.
    const int16 above = select((int16)(s->top), (int16)(s->top / 2 - 1), halved), before = halved;
    const int16 first = above * STEPS, end = first + rows * STEPS;
    const int16 start = before * STEPS, edge = start + width * STEPS;
    const int16 falls = wanted & bottom > first & top < end & right > start & left < edge &
                        wide > 0 & tall > 0 & weight > 0.0f;
    const int16 differences = IS_WIDE(layer);
    const int16 few = FLOOR_PIXELS(right - 1) - FLOOR_PIXELS(left) > 1 |
                      FLOOR_PIXELS(bottom - 1) - FLOOR_PIXELS(top) > 1 |
                      left < 0 | top < first | left >= edge | top >= end;
    const int16 narrow = select((int16)(FOUR), (int16)(FEW), few);
    vstore16(falls & select(narrow, (int16)(EDGES), differences), 0, b->kind);
    vstore16(layer, 0, b->layer);
    vstore16(left, 0, b->box[0]);
    vstore16(top, 0, b->box[1]);
    vstore16(right, 0, b->box[2]);
    vstore16(bottom, 0, b->box[3]);
    int16 at_x[2], at_y[2], along[3], down[3];
    parts_along(left, right, before, width, differences, at_x, along);
    parts_along(top, bottom, above, rows, differences, at_y, down);
    for (int k = 0; k < 2; ++k) {
        vstore16(at_x[k], 0, b->x[k]);
        vstore16(at_y[k] * (width + 1), 0, b->y[k]);
    }
    for (int k = 0; k < 3; ++k) {
        vstore16(convert_float16(along[k]), 0, b->along[k]);
        vstore16(convert_float16(down[k]), 0, b->down[k]);
    }
    const float16 area = convert_float16(wide) * convert_float16(tall);
    return select((float16)(0.0f), weight * pixel * pixel / area, falls);
}
