// Slicing by depth: a ray is spread over the box that its cell sweeps on a plane.
//
// Box edges are multiples of 1 / STEPS pixel and light is in fixed point, so sums do not depend on the order
// of rays, the number of threads or the parts in which rays are added.  Each work-item owns a strip of rows of one
// plane; no two work-items write to the same address.
//
// Boxes of the inner layers have a few pixels and are added pixel by pixel.  Layers of wide boxes hold the differences
// of such sums along both axes: there a box is 16 numbers, whatever its size (the inverse of F. Crow, "Summed-area
// tables for texture mapping", SIGGRAPH 1984).  HALVED: the widest layers have pixels of twice the picture's width, a
// quarter of the memory, and light is interpolated between them.
//
// If boxes are far wider than the distance of rays, 4 x 4 or 2 x 2 neighbours of about equal depth share a box.  Squares
// of 4 x 4 rays (FOURS) are summed once for all planes.  Rays are processed in tiles of these, or of 2 x 2 squares.
//
// STORED: rays of a file, with light in fixed-point planes (LIGHT_ONE is 1) and depth codes of type CODE.

#include "colours.cl"
#include "kernel.cl"

#define KERNEL KERNEL_OF(float16)
#define STEPS 256
#define BRIGHTEST ((float)(1 << STOPS))
#define LIGHT (1.0f / (1 << DROPPED))  // of white, over a ray's weight
#define LAYERS (2 * N_BOUNDS + 1)
#define INNER min(1, N_BOUNDS - 1)  // layers before and behind the middle layer that are not wide
#define IS_BEYOND(layer, n) ((layer) < N_BOUNDS - (n) | (layer) > N_BOUNDS + (n))
#define IS_WIDE(layer) IS_BEYOND(layer, INNER)
#define IS_HALF(layer) (-HALVED & IS_BEYOND(layer, FULL_LAYERS))
#define ABREAST 16  // rays of a row
#define TILE_ROWS (FOURS ? 4 : 2)
#define TILE_COLUMNS (TILE_ROWS * ABREAST)
// The least width of a box that side x side rays share, in distances of rays: a pixel averages the pattern of squares
// of its size.
#define SHARED(side, step) ((side) > 2.0f ? 32.0f : 2.0f * (step) <= COARSE_PX ? 8.0f : 16.0f)

#if STORED
typedef uint light_t;
typedef CODE depth_t;
#define DIOPTRES(code) table[code]
#else
typedef float light_t, depth_t;
#define LIGHT_ONE 1.0f
#define DIOPTRES(depth) (1.0f / (depth))
#endif

// Sums are modulo 2^32, or 2^64 where light above white needs more bits.  A ray's light in a pixel is rounded
// by the ray's own dither, `unit`, so that the rounding errors of many rays cancel.
#if STOPS
typedef ulong sum;
typedef ulong4 sum4;
typedef ulong8 sum8;
typedef ulong16 sum16;
#define TO_SUM(n, x) as_ulong##n(convert_long##n(x))
#else
typedef uint sum;
typedef uint4 sum4;
typedef uint8 sum8;
typedef uint16 sum16;
#define TO_SUM(n, x) as_uint##n(convert_int##n(x))
#endif

typedef struct {
    float x, y;            // position of pixel (0, 0)'s ray, in pixels of the picture
    float off_x, off_y;    // from the lens point to the middle of its cell, metres
    float side_x, side_y;  // of the cell, metres
    float share;           // open share of the cell, in units of the sums
    float unit;            // dither of pixel (0, 0)'s ray, a share of a unit
} Cell;

typedef struct {
    float delta;   // inverse focus distance
    float scale;   // pixels of the picture per metre of the lens and dioptre
    float step;    // pixels of the picture from one pixel of the slab to the next
    float pitch;   // of the lens samples, metres
} Plane;

// A strip of sums.  Each layer has an additional row and an additional pixel per row, for light that ends outside.
typedef struct {
    global sum4 *sums[LAYERS];
    int top, rows, width;
    float far;  // beyond every box that reaches a picture
} Strip;

// The number of a layer's pixels for `pixels` of the picture; halved layers have an additional one at each end.
inline int pixels_of(int pixels, int halved) { return halved ? (pixels + 1) / 2 + 2 : pixels; }

inline Strip make_strip(global sum4 *sums, int plane, int strip, int strip_rows, int2 size)
{
    const int strips = (size.y + strip_rows - 1) / strip_rows, top = strip * strip_rows;
    Strip s = {.top = top, .rows = min(strip_rows, size.y - top), .width = size.x, .far = 4.0f * max(size.x, size.y)};
    ulong count[LAYERS], all = 0;
    for (int layer = 0; layer < LAYERS; ++layer) {
        count[layer] = all;
        all += (ulong)(pixels_of(strip_rows, IS_HALF(layer)) + 1) * (pixels_of(size.x, IS_HALF(layer)) + 1);
    }
    for (int layer = 0; layer < LAYERS; ++layer)
        s.sums[layer] = sums + (ulong)(plane * strips + strip) * all + count[layer];
    return s;
}

inline int pitch_of(const Strip *s, int layer) { return pixels_of(s->width, IS_HALF(layer)) + 1; }

inline int floor_pixel(int edge) { return edge >> 8; }

// The part of [low, high] in a pixel, in 1 / STEPS.
inline int overlap(int low, int high, int pixel)
{
    return min(high, (pixel + 1) * STEPS) - max(low, pixel * STEPS);
}

// The boxes of ABREAST rays of a row: how each is added, its position, and its weights.
enum { OUTSIDE, FOUR, FEW, EDGES };
typedef struct {
    int kind[ABREAST], layer[ABREAST];
    int box[4][ABREAST];       // left, top, right and bottom edge, in 1 / STEPS
    int x[2][ABREAST];         // the first and the last column
    int y[2][ABREAST];         // rows likewise, as offsets
    float along[3][ABREAST];   // the box's parts in its columns, see parts_along
    float down[3][ABREAST];    // rows likewise
    float colour[ABREAST][4], unit[ABREAST];
} Boxes;

// Add to two pixels of a row.
inline void add_two(global sum4 *at, sum8 light)
{
    global sum *to = (global sum *)at;
    vstore8(vload8(0, to) + light, 0, to);
}

// A box of at most two pixels along each axis, inside the strip.
inline void add_four(const Strip *s, const Boxes *b, int k, global sum4 *to, float4 colour)
{
    const float8 along = (float8)((float4)(b->along[0][k]), (float4)(b->along[1][k])), light = (float8)(colour, colour);
    global sum4 *row = to + b->y[0][k] + b->x[0][k];
    add_two(row, TO_SUM(8, fma(light, along * b->down[0][k], b->unit[k])));
    add_two(row + (s->width + 1), TO_SUM(8, fma(light, along * b->down[1][k], b->unit[k])));
}

// Differences along x of the head, a whole pixel and the tail.
inline sum16 edges_of(float16 light, float16 part, float unit)
{
    const sum16 sums = TO_SUM(16, fma(light, part, unit));
    return sums - (sum16)((sum4)(0), sums.lo, sums.s89ab);
}

// Differences of a box along both axes.  Along x they are the head in the first column, a whole pixel less the head
// behind it, the tail less a whole pixel in the last column, and minus the tail behind it; rows likewise.  Nine products
// are rounded, and the sixteen numbers are their differences: they cancel behind the box, and each pixel of the box has
// one of the nine.
inline void add_edges(const Strip *s, const Boxes *b, int k, global sum4 *to, float4 colour)
{
    const float16 light = (float16)(colour, colour, colour, colour);
    const float16 along =
        (float16)((float4)(b->along[0][k]), (float4)(b->along[2][k]), (float4)(b->along[1][k]), (float4)(0.0f));
    const sum16 top = edges_of(light, along * b->down[0][k], b->unit[k]);
    const sum16 whole = edges_of(light, along * b->down[2][k], b->unit[k]);
    const sum16 low = edges_of(light, along * b->down[1][k], b->unit[k]);
    const sum16 rows[4] = {top, whole - top, low - whole, -low};
    for (int j = 0; j < 4; ++j) {
        global sum4 *row = to + b->y[j / 2][k] + j % 2 * pitch_of(s, b->layer[k]);
        add_two(row + b->x[0][k], rows[j].lo);
        add_two(row + b->x[1][k], rows[j].hi);
    }
}

inline void add_few(const Strip *s, const Boxes *b, int k, global sum4 *to, float4 colour)
{
    const int4 box = (int4)(b->box[0][k], b->box[1][k], b->box[2][k], b->box[3][k]);
    const int x0 = max(0, floor_pixel(box.x)), x1 = min(s->width - 1, floor_pixel(box.z - 1));
    const int y0 = max(s->top, floor_pixel(box.y)), y1 = min(s->top + s->rows - 1, floor_pixel(box.w - 1));
    for (int y = y0; y <= y1; ++y) {
        const int down = overlap(box.y, box.w, y);
        global sum4 *at = to + (ulong)(y - s->top) * (s->width + 1);
        for (int x = x0; x <= x1; ++x)
            at[x] += TO_SUM(4, fma(colour, (float)(down * overlap(box.x, box.z, x)), b->unit[k]));
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

// The layers of sweeps in pixels, the nearest first.
inline int16 layer_of(float16 sweep, constant const float *bounds)
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

// One axis of boxes: their first pixel and the last, counted from `first`; and the box's parts in the first, the
// last and the pixels between; or in the first two if it is not added by `differences`.  A box beyond an end is cut
// there.  If the first is the last, all three are its part: sums of different products round differently.
inline void parts_along(int16 low, int16 high, int16 first, int16 count, int16 differences, int16 at[2], int16 part[3])
{
    const int16 a = (low >> 8) - first, b = ((high - 1) >> 8) - first;
    const int16 head = STEPS - (low & (STEPS - 1)), left = min(head, high - low);
    at[0] = max(a, 0);
    at[1] = min(b, count - 1);
    part[0] = select(left, select(head, STEPS, a < 0), differences);
    part[1] = select(high - low - left, select(high - (first + b) * STEPS, STEPS, b >= count), differences);
    part[2] = STEPS;
    const int16 one = differences & at[0] == at[1], all = part[0] + part[1] - STEPS;
    for (int k = 0; k < 3; ++k) part[k] = select(part[k], all, one);
}

// The boxes about x and y of rays whose light moves by pixels per metre of the lens; returns their weights.
//
// COARSE: a pixel of a view is larger than one of the picture.  If a box's side is no whole number of view pixels,
// it overlaps its neighbours unevenly, which is visible as a pattern where few views see a surface.  So a ray has two
// boxes, with the whole numbers below and above as sides: `part` selects one.
inline float16 find_boxes(const Strip *s, const Plane *p, const Cell *cell, float16 moves, float16 x, float16 y,
                          float least, constant const float *bounds, int part, int16 wanted, Boxes *b)
{
    float16 half_x = 0.5f * max(fabs(moves) * cell->side_x, least);
    float16 half_y = 0.5f * max(fabs(moves) * cell->side_y, least), share = cell->share;
#if COARSE
    const float16 side = 2.0f * max(half_x, half_y) / p->step, whole = max(side, 1.0f), below = floor(whole);
    const int even = p->step > COARSE_PX;
    const float16 grown = even ? (below + (float)part) / side : (float16)(1.0f);
    share *= even ? fabs((float)(1 - part) - (whole - below)) : (float16)(1 - part);
    half_x *= grown;
    half_y *= grown;
#endif
    const int16 layer = layer_of(moves * p->pitch, bounds), halved = IS_HALF(layer);
    const float16 pixel = select((float16)(1.0f), (float16)(0.5f), halved);
    const int16 left = to_steps(s, (x - half_x) * pixel), top = to_steps(s, (y - half_y) * pixel);
    const int16 right = to_steps(s, (x + half_x) * pixel), bottom = to_steps(s, (y + half_y) * pixel);
    const int16 wide = right - left, tall = bottom - top;
    const int16 rows = select((int16)(s->rows), (int16)(pixels_of(s->rows, 1)), halved);
    const int16 width = select((int16)(s->width), (int16)(pixels_of(s->width, 1)), halved);
    const int16 above = select((int16)(s->top), (int16)(s->top / 2 - 1), halved), before = halved;  // first pixels
    const int16 first = above * STEPS, end = first + rows * STEPS, start = before * STEPS, edge = start + width * STEPS;
    const int16 falls = wanted & bottom > first & top < end & right > start & left < edge & wide > 0 & tall > 0 &
                        share > 0.0f;
    const int16 differences = IS_WIDE(layer);
    const int16 few = ((right - 1) >> 8) - (left >> 8) > 1 | ((bottom - 1) >> 8) - (top >> 8) > 1 | left < 0 |
                      top < first | left >= edge | top >= end;
    vstore16(falls & select(select((int16)(FOUR), (int16)(FEW), few), (int16)(EDGES), differences), 0, b->kind);
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
    return select((float16)(0.0f), share * pixel * pixel / (convert_float16(wide) * convert_float16(tall)), falls);
}

// Rows of one view from `first_row` on; steps to the next colour, pixel and row of its light.
typedef struct {
    global const light_t *light;
    global const depth_t *depth;
    global const float *table;
    ulong channel, pixel, row;
    int first_row, columns, rows, tiles;
} View;

inline View view_of(global const light_t *light, global const depth_t *depth, global const float *table, int columns,
                    int rows, int view, int first_row)
{
    const ulong count = (ulong)rows * columns, at = view * count, pixel = STORED ? 1 : 3;
    return (View){light + 3 * at, depth + at, table, STORED ? count : 1, pixel, pixel * columns,
                  first_row, columns, rows, (columns + TILE_COLUMNS - 1) / TILE_COLUMNS};
}

// ABREAST rays of a row, or squares of rays: sums of their colours and dioptres, and the least and the most dioptres.
typedef struct {
    float16 sums[4], low, high;
} Rays;

// Rays from column `start` of row `v` on; beyond the last row or column, its rays are repeated.
inline Rays read_row(const View *of, int v, int start)
{
    v = min(v, of->rows - 1);
    start = min(start, of->columns - 1);
    global const light_t *light = of->light + (ulong)v * of->row + start * of->pixel;
    global const depth_t *depth = of->depth + (ulong)v * of->columns + start;
    global const float *table = of->table;
    Rays r;
    if (start + ABREAST <= of->columns) {
#if STORED
#define TWO(k) DIOPTRES(depth[k]), DIOPTRES(depth[k + 1])
#define EIGHT(k) TWO(k), TWO(k + 2), TWO(k + 4), TWO(k + 6)
        r.low = (float16)(EIGHT(0), EIGHT(8));
        for (int c = 0; c < 3; ++c) r.sums[c] = convert_float16(vload16(0, light + c * of->channel));
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
    for (int c = 0; c < 3; ++c) r.sums[c] = clamp(r.sums[c] / (float)(LIGHT_ONE), 0.0f, BRIGHTEST) * LIGHT;
    r.sums[3] = r.high = r.low;
    return r;
}

// Squares of four: of pieces a and b of one row and c and d of the next.
inline Rays join(Rays a, Rays b, Rays c, Rays d)
{
#define PLUS(x, y) ((x) + (y))
#define PAIRS(of, x, y) of((float16)((x).even, (y).even), (float16)((x).odd, (y).odd))
    for (int k = 0; k < 4; ++k) a.sums[k] = PAIRS(PLUS, a.sums[k] + c.sums[k], b.sums[k] + d.sums[k]);
    a.low = PAIRS(min, min(a.low, c.low), min(b.low, d.low));
    a.high = PAIRS(max, max(a.high, c.high), max(b.high, d.high));
    return a;
}

// Squares of 2 x 2 from there on.
inline Rays read_squares(const View *of, int v, int start)
{
    return join(read_row(of, v, start), read_row(of, v, start + ABREAST), read_row(of, v + 1, start),
                read_row(of, v + 1, start + ABREAST));
}

// Colours and weights, ray by ray.
inline void store_colours(const float16 c[4], float to[ABREAST][4])
{
    const uint16 low = (uint16)(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23), high = low + 8;
    const uint16 first = (uint16)(0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23), last = first + 8;
    const float16 rg = shuffle2(c[0], c[1], low), bw = shuffle2(c[2], c[3], low);
    const float16 rg2 = shuffle2(c[0], c[1], high), bw2 = shuffle2(c[2], c[3], high);
    vstore16(shuffle2(rg, bw, first), 0, to[0]);
    vstore16(shuffle2(rg, bw, last), 0, to[4]);
    vstore16(shuffle2(rg2, bw2, first), 0, to[8]);
    vstore16(shuffle2(rg2, bw2, last), 0, to[12]);
}

// The targets of a view's rays.
typedef struct {
    const Strip *strip;
    Plane plane;
    Cell cell;
    constant const float *bounds;
    float least;
    int *used;  // bits of the layers with light
} Adding;

// Add the boxes that are wanted about column x and row y of the view, of side x side rays each whose light has the sum
// `light`.
inline void add_rays_at(const Adding *a, float16 moves, float16 x, float y, const float16 light[3], float side,
                        int16 wanted)
{
    const Cell *c = &a->cell;
    const float16 across = fma(x, a->plane.step, c->x) + c->off_x * moves;
    const float16 down = fma(y, a->plane.step, c->y) + c->off_y * moves;
    Boxes b;
    const float16 unit = (x * 0.7548777f + y * 0.5698403f) * (1.0f / side) + c->unit;
    vstore16(unit - floor(unit), 0, b.unit);
    for (int part = 0; part <= COARSE; ++part) {
        const float16 weight = find_boxes(a->strip, &a->plane, c, moves, across, down, a->least, a->bounds, part,
                                          wanted, &b);
        const float16 colour[4] = {light[0] * weight, light[1] * weight, light[2] * weight, weight * (side * side)};
        store_colours(colour, b.colour);
        const int16 kind = vload16(0, b.kind);
        for (int k = FOUR; k <= EDGES; ++k)
            if (any(kind == k)) *a->used |= add_kind(a->strip, &b, k);
    }
}

#define ALONG (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)

// Add squares of side x side rays as one box each, where they are wanted, boxes are wide, and sweeps differ by an
// eighth at most; returns where.  The first of ABREAST squares is at column `start` of row `v`.  Pictures have 66 dB
// and more if squares of 4 x 4 are added too, against those with squares of 2 x 2 alone; and these 69 dB against
// pictures of single rays.  Not inline: slicing with two copies takes 3% longer.
__attribute__((noinline)) static int16 add_squares(const Adding *a, const View *of, Rays rays, int v, int start,
                                                   float side, int16 wanted)
{
    const float scale = a->plane.scale * min(a->cell.side_x, a->cell.side_y) / a->plane.step;
    const float16 low = (a->plane.delta - rays.high) * scale, high = (a->plane.delta - rays.low) * scale;
    const float16 least = max(low, -high);
    const int16 whole = (ALONG + 1.0f) * side <= (float)(of->columns - start) & (int16)(-(v + side <= of->rows));
    const int16 shared = wanted & whole & least >= SHARED(side, a->plane.step) & (high - low) * 8.0f <= least;
    if (!any(shared)) return 0;
    const float middle = 0.5f * (side - 1.0f);
    const float16 moves = (a->plane.delta - rays.sums[3] * (1.0f / (side * side))) * a->plane.scale;
    add_rays_at(a, moves, ALONG * side + (start + middle), of->first_row + v + middle, rays.sums, side, shared);
    return shared;
}

// From a mask of sixteen squares that of the sixteen smaller ones (or rays) in a row of its first or last eight.
#define WITHIN(squares, second) ((second) ? (squares).hi : (squares).lo).s0011223344556677

// Add ABREAST squares of 2 x 2 rays, where they are wanted: as one box each, or else ray by ray, of rows whose bit is
// among `reached`.
inline void add_twos(const Adding *a, const View *of, int v, int start, int reached, int16 wanted)
{
    if (!any(wanted)) return;
    if (!COARSE) wanted &= ~add_squares(a, of, read_squares(of, v, start), v, start, 2.0f, wanted);
    for (int k = 0; k < 4; ++k) {
        const int y = v + k / 2, x = start + k % 2 * ABREAST;
        const int16 single = WITHIN(wanted, k % 2) & ALONG < (float)(of->columns - x);
        if (!(reached >> k / 2 & 1) || !any(single)) continue;
        const Rays rays = read_row(of, y, x);
        add_rays_at(a, (a->plane.delta - rays.low) * a->plane.scale, ALONG + (float)x, of->first_row + y, rays.sums,
                    1.0f, single);
    }
}

// Add the rays of a tile: as squares of 4 x 4 where these may be (FOURS), elsewhere as squares of 2 x 2.
inline void add_tile(const Adding *a, const View *of, global const Rays *fours, int v, int start, int reached)
{
#if FOURS
    const int16 left = ~add_squares(a, of, *fours, v, start, 4.0f, (int16)(-1));
    for (int k = 0; k < 4; ++k)
        add_twos(a, of, v + k / 2 * 2, start + k % 2 * 2 * ABREAST, reached >> k / 2 * 2, WITHIN(left, k % 2));
#else
    add_twos(a, of, v, start, reached, (int16)(-1));
#endif
}

// Whether any ray of `rows` rows, from row `v` on, reaches the strip; `ranges` are their depths.
inline int reaches(const Adding *a, float v, int rows, global const float2 *ranges)
{
    float most = 0.0f;
    for (int k = 0; k < rows; ++k) {
        const float2 moves = fabs(a->plane.delta - 1.0f / ranges[k]) * a->plane.scale;
        most = max(most, max(moves.x, moves.y));
    }
    const float y = fma(v + 0.5f * (rows - 1), a->plane.step, a->cell.y), more = HALVED ? 4.0f : 1.0f;
    const float box = max(most * a->cell.side_y, a->least);
    const float reach = 0.5f * (box + rows * a->plane.step) + fabs(a->cell.off_y) * most;
    return y + reach + more >= a->strip->top && y - reach - more <= a->strip->top + a->strip->rows;
}

#if FOURS
// Squares of 4 x 4 rays of a row of tiles.
KERNEL
void join_rays(global const light_t *restrict light,  // as below
               global const depth_t *restrict depth,
               global const float *restrict table,
               const int columns,
               const int rows,
               global Rays *restrict fours)           // (views, rows of tiles, tiles of a row)
{
    const int v = get_global_id(0) * TILE_ROWS, view = get_global_id(1);
    const View of = view_of(light, depth, table, columns, rows, view, 0);
    fours += (ulong)(view * get_global_size(0) + get_global_id(0)) * of.tiles;
    for (int k = 0; k < of.tiles; ++k) {
        const int start = k * TILE_COLUMNS, middle = start + TILE_COLUMNS / 2;
        fours[k] = join(read_squares(&of, v, start), read_squares(&of, v, middle),
                        read_squares(&of, v + 2, start), read_squares(&of, v + 2, middle));
    }
}
#endif

KERNEL
void add_rays(global const light_t *restrict light,  // (views, rows, columns, 3); (views, 3, rows, columns) if STORED
              global const depth_t *restrict depth,  // (views, rows, columns), metres, or codes
              global const float *restrict table,    // dioptres of each code
              global const Rays *restrict fours,     // by join_rays, if FOURS
              global const float2 *restrict ranges,  // (views, rows) least and most depth of a row
              global const Cell *restrict cells,     // (planes, views)
              global const Plane *restrict planes,
              constant float *restrict bounds,       // (planes, N_BOUNDS + 1) sweeps
              const int n_views,
              const int columns,
              const int rows,
              const int first_row,                   // of the views
              const float least,                     // side of a box, pixels
              const int strip_rows,
              const int width,                       // of the pictures
              const int height,
              global sum4 *restrict sums,
              global int *restrict used)             // (planes, strips) bits of layers
{
    const int plane = get_global_id(1);
    const Strip s = make_strip(sums, plane, get_global_id(0), strip_rows, (int2)(width, height));
    const Plane p = planes[plane];
    int layers = 0;
    for (int view = 0; view < n_views; ++view) {
        const Cell cell = cells[plane * n_views + view];
        if (!(cell.share > 0.0f)) continue;
        const Adding a = {&s, p, cell, bounds + plane * (N_BOUNDS + 1), least, &layers};
        const View of = view_of(light, depth, table, columns, rows, view, first_row);
        for (int v = 0; v < rows; v += TILE_ROWS) {
            global const float2 *range = ranges + (ulong)view * rows + v;
            const int count = min(TILE_ROWS, rows - v);
            if (!reaches(&a, first_row + v, count, range)) continue;
            int reached = 0;
            for (int k = 0; k < count; ++k) reached |= reaches(&a, first_row + v + k, 1, range + k) << k;
            const ulong at = (view * ((rows + TILE_ROWS - 1) / TILE_ROWS) + v / TILE_ROWS) * (ulong)of.tiles;
            for (int k = 0; k < of.tiles; ++k)
                add_tile(&a, &of, &fours[at + k], v, k * TILE_COLUMNS, reached);
        }
    }
    used[plane * get_global_size(0) + get_global_id(0)] |= layers;
}

// The last row of a wide layer that row `y` of a strip needs.
inline int last_row(int layer, int y) { return IS_HALF(layer) ? (y + 1) / 2 + 1 : y; }

// Light of a pixel of a layer.  Wide layers keep their last two rows of sums in the first two rows; in halved ones, a
// pixel of the picture lies between two pixels along each axis.
inline float4 light_at(const Strip *s, int layer, int x, int y)
{
    const int pitch = pitch_of(s, layer);
    global const sum4 *sums = s->sums[layer];
    if (!IS_HALF(layer)) return convert_float4(sums[(IS_WIDE(layer) ? y & 1 : y) * pitch + x]);
    const int column = x / 2 + 1, row = y / 2 + 1, beside = column + (x % 2 ? 1 : -1);
    global const sum4 *near = sums + row % 2 * pitch, *far = sums + (row + 1) % 2 * pitch;
    return (convert_float4(near[column]) * 9.0f + (convert_float4(near[beside]) + convert_float4(far[column])) * 3.0f +
            convert_float4(far[beside])) * 0.0625f;
}

// The least sum, in units, that determines a colour: each added part may be off by one.
#define LEAST_UNITS 1024.0f

// Form a picture from the sums: layers front to back, each covering at most the part of a pixel that nearer layers left
// open.  Beside an edge, light from behind is partly spread over the occluder, where it is lost.  So all layers but the
// first fill the open rest of a pixel, with at most the light that they have.  Near the ends of views, layers with wider
// sweeps have less weight.
KERNEL void compose(global sum4 *restrict sums,
                    global const int *restrict used,    // (planes, strips) bits of layers
                    global const float *restrict rooms,  // (rows, width): weight of all rays at a pixel, as sums
                    global const int *restrict row_of,   // (LAYERS, height) rows of `rooms`
                    const int strip_rows,
                    const int width,
                    const int height,
                    global float *restrict picture)     // (height, width, 3)
{
    const int plane = get_global_id(1);
    const Strip s = make_strip(sums, plane, get_global_id(0), strip_rows, (int2)(width, height));
    const float4 light = (float4)((float3)(LIGHT), 1.0f);
    int list[LAYERS], count = 0;
    for (int layer = 0; layer < LAYERS; ++layer) {
        list[count] = layer;
        count += used[plane * get_global_size(0) + get_global_id(0)] >> layer & 1;
    }
    for (int y = 0; y < s.rows; ++y) {
        for (int k = 0; k < count; ++k) {
            if (!IS_WIDE(list[k])) continue;
            const int pitch = pitch_of(&s, list[k]);
            for (int row = y ? last_row(list[k], y - 1) + 1 : 0; row <= last_row(list[k], y); ++row) {
                // The first two rows hold the running sums in turn: pages that are only read take no memory.
                global sum4 *from = s.sums[list[k]] + row * pitch, *to = s.sums[list[k]] + row % 2 * pitch;
                global const sum4 *before = s.sums[list[k]] + (row + 1) % 2 * pitch;
                sum4 along = 0;
                for (int x = 0; x < pitch - 1; ++x) {
                    along += from[x];
                    to[x] = row ? before[x] + along : along;
                }
            }
        }
        for (int x = 0; x < width; ++x) {
            const ulong at = (ulong)(s.top + y) * width + x;
            float left = 1.0f;
            float4 total = 0.0f, first = 0.0f;
            for (int k = 0; k < count; ++k) {
                const float room = rooms[(ulong)row_of[list[k] * height + s.top + y] * width + x];
                const float4 units = light_at(&s, list[k], x, y);
                if (!(units.w >= LEAST_UNITS && room > 0.0f)) continue;
                const float4 found = units / (light * room);
                const float used = min(found.w, left);
                total += found * (used / found.w);
                left -= used;
                if (!(first.w > 0.0f)) first = total;
            }
            const float4 behind = total - first;
            if (behind.w > 0.0f) total += behind * min(left / behind.w, 1.0f);
            vstore3(total.w > 0.0f ? total.xyz / total.w : 0.0f, at, picture);
        }
    }
}
