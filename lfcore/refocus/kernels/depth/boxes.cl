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

// Rays spread over areas of a plane: their middles and half their sides, in pixels, and weights.
typedef struct { float16 x, y, half_x, half_y, weight; } Spread;

// COARSE: a pixel of a view is larger than one of the picture.  If a box's side is no whole number
// of view pixels, it overlaps its neighbours unevenly, which is visible as a pattern where few
// views see a surface.  So a ray has two boxes, with the whole numbers below and above as sides:
// `part` selects one.  Grows the halves of a side and scales the weights.
inline void make_even(float step, int part, Spread *a)
{
    const int even = step > COARSE_PX;
    const float16 side = 2.0f * max(a->half_x, a->half_y) / step;
    const float16 whole = max(side, 1.0f), below = floor(whole);
    const float16 grown = even ? (below + (float)part) / side : (float16)(1.0f);
    a->weight *= even ? fabs((float)(1 - part) - (whole - below)) : (float16)(1 - part);
    a->half_x *= grown;
    a->half_y *= grown;
}

// The pixels of a strip in sixteen layers: the first column and row, and their numbers.
typedef struct { int16 left, top, width, rows; } Area;

// Halved layers have an additional pixel at each end, so they begin at pixel -1.
inline Area area_of(const Strip *s, int16 halved)
{
    return (Area){
        .left = select((int16)(0), (int16)(-1), halved),
        .top = select((int16)(s->top), (int16)(s->top / 2 - 1), halved),
        .width = select((int16)(s->width), (int16)(pixels_of(s->width, 1)), halved),
        .rows = select((int16)(s->rows), (int16)(pixels_of(s->rows, 1)), halved)};
}

// The edges of boxes in 1 / STEPS pixel of their layers.
typedef struct { int16 left, top, right, bottom; } Edges;

// `pixel`: the pixels of the layers per pixel of the picture.
inline Edges edges_of_boxes(const Strip *s, const Spread *a, float16 pixel)
{
    return (Edges){.left = to_steps(s, (a->x - a->half_x) * pixel),
                   .top = to_steps(s, (a->y - a->half_y) * pixel),
                   .right = to_steps(s, (a->x + a->half_x) * pixel),
                   .bottom = to_steps(s, (a->y + a->half_y) * pixel)};
}

// Mask of boxes with a part inside the area.
inline int16 overlap_area(const Edges *e, const Area *a)
{
    return e->right > a->left * STEPS & e->left < (a->left + a->width) * STEPS &
           e->bottom > a->top * STEPS & e->top < (a->top + a->rows) * STEPS;
}

// Mask of boxes that begin outside the area.
inline int16 begin_outside(const Edges *e, const Area *a)
{
    return e->left < a->left * STEPS | e->left >= (a->left + a->width) * STEPS |
           e->top < a->top * STEPS | e->top >= (a->top + a->rows) * STEPS;
}

// Mask of boxes that lie in more than two pixels along an axis.
inline int16 exceed_two(const Edges *e)
{
    return FLOOR_PIXELS(e->right - 1) - FLOOR_PIXELS(e->left) > 1 |
           FLOOR_PIXELS(e->bottom - 1) - FLOOR_PIXELS(e->top) > 1;
}

// The pixels of boxes, counted from the first of the area, and their parts in them.
inline void store_parts(const Edges *e, const Area *a, int16 differences, Boxes *b)
{
    int16 x[2], y[2], along[3], down[3];
    parts_along(e->left, e->right, a->left, a->width, differences, x, along);
    parts_along(e->top, e->bottom, a->top, a->rows, differences, y, down);
    for (int k = 0; k < 2; ++k) {
        vstore16(x[k], 0, b->x[k]);
        vstore16(y[k] * (a->width + 1), 0, b->y[k]);
    }
    for (int k = 0; k < 3; ++k) {
        vstore16(convert_float16(along[k]), 0, b->along[k]);
        vstore16(convert_float16(down[k]), 0, b->down[k]);
    }
}

// The boxes of the rays in the mask `wanted`, in their layers; returns weights per part of a pixel,
// 0 where no box meets the strip.
inline float16 find_boxes(const Strip *s, const Spread *rays, int16 layer, int16 wanted, Boxes *b)
{
    int16 differences = ARE_BEYOND(layer, NARROW_LAYERS);
    const int16 halved = -HALVED & ARE_BEYOND(layer, FULL_LAYERS);
    const float16 pixel = select((float16)(1.0f), (float16)(0.5f), halved);
    const Area area = area_of(s, halved);
    const Edges e = edges_of_boxes(s, rays, pixel);
    const int16 wide = e.right - e.left, tall = e.bottom - e.top;
#if LARGE_LAYERS
    const float16 pixels = convert_float16(wide + STEPS) * convert_float16(tall + STEPS);
    const int16 large = ~differences & pixels > LARGE_BOX_PX * STEPS * STEPS;
    layer = select(layer, LARGE_OF(layer), large);
    differences |= large;
#endif
    const int16 falls = wanted & overlap_area(&e, &area) & wide > 0 & tall > 0 & rays->weight > 0.0f;
    const int16 pixel_by_pixel = exceed_two(&e) | begin_outside(&e, &area);
    const int16 narrow = select((int16)(FOUR), (int16)(FEW), pixel_by_pixel);
    vstore16(falls & select(narrow, (int16)(EDGES), differences), 0, b->kind);
    vstore16(layer, 0, b->layer);
    vstore16(e.left, 0, b->box[0]);
    vstore16(e.top, 0, b->box[1]);
    vstore16(e.right, 0, b->box[2]);
    vstore16(e.bottom, 0, b->box[3]);
    store_parts(&e, &area, differences, b);
    const float16 size = convert_float16(wide) * convert_float16(tall);
    return select((float16)(0.0f), rays->weight * pixel * pixel / size, falls);
}
