// Slicing by depth: a ray is spread over the box that its lens cell sweeps on a plane.
//
// If boxes are far wider than the distance of rays, 4 x 4 or 2 x 2 neighbours of about equal depth
// share a box.  Squares of 4 x 4 rays (FOURS) are summed once for all planes.
#include "add_boxes.cl"
#include "lens.cl"
#include "rays.cl"

// The least width of a box that side x side rays share, in distances of rays.  Squares of 2 x 2
// rays that are not larger than a pixel leave no pattern in it, so narrower boxes suffice.
#define LEAST_SHARED(side, step)                     \
    ((side) > 2.0f             ? SHARED_BY_FOURS     \
     : 2.0f * (step) <= COARSE_PX ? SHARED_BY_SMALL_TWOS \
                               : SHARED_BY_TWOS)

// Colours and weights, ray by ray.
inline void store_colours(const float16 c[4], float to[ABREAST][4])
{
    const uint16 low = (uint16)(0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21, 6, 22, 7, 23);
    const uint16 high = low + 8;
    const uint16 first = (uint16)(0, 1, 16, 17, 2, 3, 18, 19, 4, 5, 20, 21, 6, 7, 22, 23);
    const uint16 last = first + 8;
    const float16 rg = shuffle2(c[0], c[1], low), bw = shuffle2(c[2], c[3], low);
    const float16 rg2 = shuffle2(c[0], c[1], high), bw2 = shuffle2(c[2], c[3], high);
    vstore16(shuffle2(rg, bw, first), 0, to[0]);
    vstore16(shuffle2(rg, bw, last), 0, to[4]);
    vstore16(shuffle2(rg2, bw2, first), 0, to[8]);
    vstore16(shuffle2(rg2, bw2, last), 0, to[12]);
}

// A view's rays on the way to a strip of a plane.
typedef struct {
    const Strip *strips;  // of each sheet
    const View *rays;
    FocusPlane plane;
    PlacedView view;
    int *used;  // bits of the layers with light, of each sheet
    global const uchar *present;  // of the view, if its rays are sparse
    global const float16 *nodes;  // of the view's colours behind a lens from a file
} Adding;

// The nodes of a colour.
#define NODES_OF(a, colour) ((a)->nodes + (colour) * LENS_NODES * LENS_NODES)

// Add the boxes that are wanted about column x and row y of the view, of side x side rays each
// whose light has the sum `light`.  Colours share a box that is green's, if it is about theirs.
inline void add_rays_at(const Adding *a, float16 moves, float16 x, float y, const float16 light[3],
                        float side, int16 wanted)
{
    const PlacedView *v = &a->view;
    const float least = a->rays->numbers->least_box;
#if LENS
    const float16 across = fma(x, a->plane.step, v->x);
    const float down = fma(y, a->plane.step, v->y);
    float16 apart;
    Spread rays = land(a->rays->numbers, NODES_OF(a, COLOURS / 2), v, across, down, moves, least,
                       &apart);
    const float16 nearby = COLOURS_PX * max(2.0f * min(rays.half_x, rays.half_y), 1.0f);
    const int16 shared = wanted & (COLOURS == 1 | apart <= nearby);
#else
    const Spread rays = {.x = fma(x, a->plane.step, v->x) + v->offset_x * moves,
                         .y = fma(y, a->plane.step, v->y) + v->offset_y * moves,
                         .half_x = 0.5f * max(fabs(moves) * v->side_x, least),
                         .half_y = 0.5f * max(fabs(moves) * v->side_y, least),
                         .weight = (float16)(v->weight)};
    const int16 shared = wanted;
#endif
    const int16 layer = layer_of(moves * a->plane.pitch, a->plane.bounds);
    Boxes b;
    const float16 dither = (x * DITHER_X + y * DITHER_Y) * (1.0f / side) + v->dither;
    vstore16(dither - floor(dither), 0, b.dither);
    for (int part = 0; part < (COARSE + 1) * SHEETS; ++part) {
        const int sheet = part % SHEETS;
        const int16 here = sheet ? wanted & ~shared : shared;
        if (!any(here)) continue;
#if SHEETS > 1
        if (sheet)
            rays = land(a->rays->numbers, NODES_OF(a, sheet - 1), v, across, down, moves, least,
                        &apart);
#endif
        Spread spread = rays;
        if (COARSE) make_even(a->plane.step, part / SHEETS, &spread);
        const float16 weight = find_boxes(a->strips + sheet, &spread, layer, here, &b);
        float16 colour[4] = {0.0f, 0.0f, 0.0f, weight * (side * side)};
        for (int c = 0; c < 3; ++c)
            if (!sheet || sheet == c + 1) colour[c] = light[c] * weight;
        store_colours(colour, b.colour);
        const int16 kind = vload16(0, b.kind);
        for (int k = FOUR; k <= EDGES; ++k)
            if (any(kind == k)) a->used[sheet] |= add_kind(a->strips + sheet, &b, k);
    }
}

#define ALONG (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)

// Add squares of side x side rays as one box each, where they are wanted, boxes are wide, and
// sweeps differ little; returns where.  The first of ABREAST squares is at column `start` of row
// `v`.  Not inline: slicing with two copies takes 3% longer.
__attribute__((noinline)) static int16 add_squares(const Adding *a, RaySums squares, int v,
                                                   int start, float side, int16 wanted)
{
    const View *of = a->rays;
    const float scale = a->plane.scale * min(a->view.side_x, a->view.side_y) / a->plane.step;
    const float16 low = (a->plane.delta - squares.high) * scale;
    const float16 high = (a->plane.delta - squares.low) * scale;
    const float16 least = max(low, -high);
    const int16 whole = (ALONG + 1.0f) * side <= (float)(of->columns - start) &
                        (int16)(-(v + side <= of->rows));
    const int16 shared = wanted & whole & least >= LEAST_SHARED(side, a->plane.step) &
                         (high - low) * SHARED_SWEEPS <= least;
    if (!any(shared)) return 0;
    const float middle = 0.5f * (side - 1.0f);
    const float16 mean = squares.sums[3] * (1.0f / (side * side));
    add_rays_at(a, (a->plane.delta - mean) * a->plane.scale, ALONG * side + (start + middle),
                of->numbers->first_row + v + middle, squares.sums, side, shared);
    return shared;
}

// The mask of sixteen smaller squares (or rays) in a row of the first or last eight of `squares`,
// from the mask of these.
#define WITHIN(squares, second) ((second) ? (squares).hi : (squares).lo).s0011223344556677

// Add ABREAST squares of 2 x 2 rays, where they are wanted: as one box each, or else ray by ray, of
// rows whose bit is among `reached`.
inline void add_twos(const Adding *a, int v, int start, int reached, int16 wanted)
{
    const View *of = a->rays;
    if (!any(wanted)) return;
    if (!COARSE) wanted &= ~add_squares(a, read_squares(of, v, start), v, start, 2.0f, wanted);
    for (int k = 0; k < 4; ++k) {
        const int y = v + k / 2, x = start + k % 2 * ABREAST;
        const int16 single = WITHIN(wanted, k % 2) & ALONG < (float)(of->columns - x);
        if (!(reached >> k / 2 & 1) || !any(single)) continue;
        const RaySums rays = read_row(of, y, x);
        const int16 present = single & rays.low < MOST_DIOPTRES;
        if (!any(present)) continue;
        add_rays_at(a, (a->plane.delta - rays.low) * a->plane.scale, ALONG + (float)x,
                    of->numbers->first_row + y, rays.sums, 1.0f, present);
    }
}

// Whether any ray of `rows` rows, from row `v` on, reaches the strip; `ranges` are their depths,
// the first above the second in rows without rays.
inline int reaches(const Adding *a, float v, int rows, global const float2 *ranges)
{
    float most = -1.0f;
    for (int k = 0; k < rows; ++k) {
        if (ranges[k].x > ranges[k].y) continue;
        const float2 moves = fabs(a->plane.delta - 1.0f / ranges[k]) * a->plane.scale;
        most = max(most, max(moves.x, moves.y));
    }
    if (most < 0.0f) return 0;
    const float y = fma(v + 0.5f * (rows - 1), a->plane.step, a->view.y);
    const float more = HALVED ? 4.0f : 1.0f;  // pixels: what rounding and halved layers add
    const float box = max(most * a->view.side_y, a->rays->numbers->least_box);
    float reach = 0.5f * (box + rows * a->plane.step) + fabs(a->view.offset_y) * most;
#if LENS
    const float16 node = row_at(a->rays->numbers, NODES_OF(a, COLOURS / 2), y)[0];
    reach += node.sb + node.sc * most;
#endif
    return y + reach + more >= a->strips->top &&
           y - reach - more <= a->strips->top + a->strips->rows;
}

// Whether the patch from column `start` of row `v` on has any ray.
inline int is_present(const Adding *a, int v, int start)
{
    const int across = (a->rays->columns + PATCH_COLUMNS - 1) / PATCH_COLUMNS;
    return !a->rays->numbers->sparse ||
           a->present[v / PATCH_ROWS * across + start / PATCH_COLUMNS];
}

#if FOURS
// Sum the squares of 4 x 4 rays of a row of patches, (views, rows of patches, patches of a row).
KERNEL void join_rays(join_rays_PARAMETERS)
{
    const int v = get_global_id(0) * PATCH_ROWS, view = get_global_id(1);
    const View of = view_of(light, depth, dioptres, &numbers, view);
    fours += (ulong)(view * get_global_size(0) + get_global_id(0)) * of.groups;
    for (int k = 0; k < of.groups; ++k) {
        const RaySums sums = read_fours(&of, v, k * PATCH_COLUMNS);
        store_squares(&sums, fours + k);
    }
}

// Add a row of patches: as squares of 4 x 4 where these may be, elsewhere as squares of 2 x 2.
inline void add_patches(const Adding *a, global const Squares *fours, int v, int reached)
{
    for (int patch = 0; patch < a->rays->groups; ++patch) {
        const int start = patch * PATCH_COLUMNS;
        if (!is_present(a, v, start)) continue;
        const RaySums squares = load_squares(fours + patch);
        const int16 left = ~add_squares(a, squares, v, start, 4.0f, (int16)(-1));
        for (int k = 0; k < 4; ++k)
            add_twos(a, v + k / 2 * 2, start + k % 2 * 2 * ABREAST, reached >> k / 2 * 2,
                     WITHIN(left, k % 2));
    }
}
#else
inline void add_groups(const Adding *a, int v, int reached)
{
    for (int group = 0; group < a->rays->groups; ++group)
        if (is_present(a, v, group * GROUP_COLUMNS))
            add_twos(a, v, group * GROUP_COLUMNS, reached, (int16)(-1));
}
#endif

// Add all rays to a strip of a plane.
KERNEL void add_rays(add_rays_PARAMETERS)
{
    const int plane = get_global_id(1), rows = numbers.rows;
    Strip strips[SHEETS];
    int layers[SHEETS];
    for (int k = 0; k < SHEETS; ++k) {
        strips[k] = make_strip(sums, plane * SHEETS + k, get_global_id(0), &numbers);
        layers[k] = 0;
    }
    for (int view = 0; view < numbers.views; ++view) {
        const PlacedView placed = views[plane * numbers.views + view];
        if (!(placed.weight > 0.0f)) continue;
        const View of = view_of(light, depth, dioptres, &numbers, view);
        const int down = (rows + PATCH_ROWS - 1) / PATCH_ROWS;
        const int across = (numbers.columns + PATCH_COLUMNS - 1) / PATCH_COLUMNS;
        const ulong first = numbers.sparse ? (ulong)view * down * across : 0;
        const ulong grid = (ulong)(plane * numbers.views + view) * COLOURS;
        const Adding a = {strips, &of, planes[plane], placed, layers, present + first,
                          lens + grid * LENS_NODES * LENS_NODES};
        for (int v = 0; v < rows; v += GROUP_ROWS) {
            global const float2 *range = ranges + (ulong)view * rows + v;
            const int count = min(GROUP_ROWS, rows - v);
            if (!reaches(&a, numbers.first_row + v, count, range)) continue;
            int reached = 0;
            for (int k = 0; k < count; ++k)
                reached |= reaches(&a, numbers.first_row + v + k, 1, range + k) << k;
#if FOURS
            const int row = view * down + v / PATCH_ROWS;
            add_patches(&a, fours + row * (ulong)of.groups, v, reached);
#else
            add_groups(&a, v, reached);
#endif
        }
    }
    for (int k = 0; k < SHEETS; ++k) {
        if (LARGE_LAYERS) layers[k] |= layers[k] >> LAYERS << FIRST_NARROW;
        used[(plane * SHEETS + k) * get_global_size(0) + get_global_id(0)] |= layers[k];
    }
}
