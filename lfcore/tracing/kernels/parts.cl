// What each of few triangles has of a block, as sets of rays.
//
// Most blocks on which several triangles are seen show a few, and planes that do not cross within the block: which
// is nearer needs no depth of a ray.  A triangle's rays are found first, sixteen bits a row, all rows at once; where
// those of two meet, depths are compared, by their ranges over the block if these part, else ray by ray.
#ifndef LFCORE_PARTS_CL
#define LFCORE_PARTS_CL
#include "triangles.cl"
#include "series.cl"

#if SHARED
// A block of more triangles has a depth buffer, and from the start if it may meet more than FEW_KEPT: measured.
#define PARTS 8
#ifndef FEW_KEPT
#define FEW_KEPT 16
#endif

typedef struct {
    int id;
    Form over, under;   // depth is their quotient
    float near, far;    // bounds of it, far enough from each other's for rounding
    int rays[BLOCK];    // a bit for each column of a row
} Part;

typedef struct {
    int count;
    float near, far;    // bounds of all depths
    int open[BLOCK];    // rays of no part
    Part of[PARTS + 1]; // no two have a ray in common; room for one to be added
} Parts;
#define PARTS_WORDS (BLOCK + 3 + (PARTS + 1) * (BLOCK + 9))

inline void clear_parts(global Parts *parts)
{
    parts->count = 0;
    parts->near = FAR;
    parts->far = 0.0f;
    for (int row = 0; row < BLOCK; row += LANES) VSTORE((vi)(0xffff), parts->open + row);
}

inline vf row_places(int first) { return IOTA + (first - HALF); }

// An edge over a block: its sign changes once along a row.
typedef struct {
    float c, j;
    float turn;  // -1 / i
    int falls;   // mask of whether i is not positive
} Turning;

// Below this, 1 / i loses digits.
#define LEAST_TURN 1.0e-25f

// One along the rows is of one sign in each: it changes past one end or the other.
inline Turning make_turning(float c, float i, float j)
{
    const Turning t = {c, j, fabs(i) < LEAST_TURN ? 1.0f / LEAST_TURN : -1.0f / i, i >= LEAST_TURN ? 0 : -1};
    return t;
}

// Columns in which an edge is not negative, a bit for each, and bits that are of no column, of LANES rows at places y.
// Edges are widened by more than the place where it changes may be off.
inline vi turned_columns(Turning t, vf y)
{
    const vf place = fma(fma(y, (vf)(t.j), (vf)(t.c)), (vf)(t.turn), (vf)(HALF));
    return ((vi)(-1) << TO_VI(ceil(clamp(place, (vf)(0.0f), (vf)(BLOCK))))) ^ t.falls;
}

// Rays of the rows from place `first` to `last` that a triangle meets, whose denominator of depth is positive all over
// the block; returns whether there are any.
inline int find_rays(private const float *c, uint lane, float first, float last, global int *rays)
{
    vi any = 0;
    c += lane;
    const Turning a = make_turning(c[0], c[LANES], c[2 * LANES]), b = make_turning(c[3 * LANES], c[4 * LANES], c[5 * LANES]);
    const Turning g = make_turning(c[6 * LANES], c[7 * LANES], c[8 * LANES]);
    for (int row = 0; row < BLOCK; row += LANES) {
        const vf y = row_places(row);
        const vi within = GE(y, (vf)(first)) & LE(y, (vf)(last)) & 0xffff;
        const vi met = turned_columns(a, y) & turned_columns(b, y) & turned_columns(g, y) & within;
        VSTORE(met, rays + row);
        any |= met;
    }
    return row_any(any);
}

// Of the rays in `rows`, LANES rows from `first` on, those on which depth over / under of triangle `id` is nearer
// than that of `other_id`, ray by ray.
inline vi compare_rays(Form over, Form under, int id, Form other_over, Form other_under, int other_id, vi rows, int first)
{
    const vf y = row_places(first);
    const vf a = fma(y, (vf)(over.j), (vf)(over.c)), b = fma(y, (vf)(under.j), (vf)(under.c));
    const vf c = fma(y, (vf)(other_over.j), (vf)(other_over.c)), d = fma(y, (vf)(other_under.j), (vf)(other_under.c));
    vi nearer = 0;
    for (uint columns = row_or(rows); columns; columns &= columns - 1) {
        const int column = lowest(columns);
        const vf x = column - HALF;
        const vf z = fma(x, (vf)(over.i), a) * reciprocal(fma(x, (vf)(under.i), b));
        const vf w = fma(x, (vf)(other_over.i), c) * reciprocal(fma(x, (vf)(other_under.i), d));
        nearer |= (LT(AS_VU(z), AS_VU(w)) | (id < other_id ? EQ(AS_VU(z), AS_VU(w)) : (vi)(0))) & (1 << column);
    }
    return nearer & rows;
}

// Two triangles with depths over / under, and where either is surely the nearer: the rays of a block meet in one point,
// or are parallel, and so the difference of depths times both denominators is affine; terms of second order cancel.
typedef struct {
    Form over, under, other_over, other_under;
    int id, other_id;
    Turning nearer, farther;
} Order;

// Depths that differ by less, relative to them, are to be compared ray by ray.
#define CLOSE_DEPTHS 2.0e-5f

inline Order make_order(Form over, Form under, int id, Form other_over, Form other_under, int other_id)
{
    Order o = {over, under, other_over, other_under, id, other_id};
    const float r = 1.0f / under.c, s = 1.0f / other_under.c, z = over.c * r, w = other_over.c * s, close = CLOSE_DEPTHS * max(z, w);
    const float i = (over.i * r - other_over.i * s) + (z * other_under.i * s - w * under.i * r);
    const float j = (over.j * r - other_over.j * s) + (z * other_under.j * s - w * under.j * r);
    o.nearer = make_turning(w - z - close, -i, -j);
    o.farther = make_turning(z - w - close, i, j);
    return o;
}

// Of the rays in `rows`, LANES rows from `first` on, those on which the first of two triangles is nearer.
inline vi nearer_rays(const Order *o, vi rows, int first)
{
    const vf y = row_places(first);
    const vi nearer = rows & turned_columns(o->nearer, y), close = rows & ~nearer & ~turned_columns(o->farther, y);
    if (!row_any(close)) return nearer;
    return nearer | compare_rays(o->over, o->under, o->id, o->other_over, o->other_under, o->other_id, close, first);
}

// Mask of a part's rays in the row of LANES that begins with ray `at`.
inline vi part_row(global const Part *p, int at) { return MASK(((vi)(p->rays[at / BLOCK] >> at % BLOCK) & LANE_BITS) != 0); }

// Divide the rays that `p` and `q` have in common; returns whether `q` is left without any.  Which of two is nearer
// cannot be foreseen, and is no branch; that their depths must be compared is rare.
inline int divide_rays(global Part *p, global Part *q)
{
    const vi front = p->far < q->near ? -1 : 0, behind = p->near > q->far ? -1 : 0;
    vi compare = 0, left = 0;
    for (int row = 0; row < BLOCK; row += LANES) compare |= VLOAD(p->rays + row) & VLOAD(q->rays + row) & ~(front | behind);
    const int unknown = row_any(compare);
    Order order;
    if (unknown) order = make_order(p->over, p->under, p->id, q->over, q->under, q->id);
    for (int row = 0; row < BLOCK; row += LANES) {
        const vi mine = VLOAD(p->rays + row), theirs = VLOAD(q->rays + row), both = mine & theirs;
        vi won = both & front;
        if (unknown) won = nearer_rays(&order, both, row);
        VSTORE(mine & (won | ~both), p->rays + row);
        VSTORE(theirs & ~won, q->rays + row);
        left |= theirs & ~won;
    }
    return !row_any(left);
}

// Columns and rows, a bit for each, that hold some of the rays in the first `open` columns and rows of a block.
inline uint2 places_of(global const int *rays, int2 open)
{
    vi any = 0;
    uint rows = 0;
    for (int row = 0; row < BLOCK; row += LANES) {
        const vi some = LT(TO_VI(IOTA) + row, (vi)(open.y)) & VLOAD(rays + row) & ((1 << open.x) - 1);
        any |= some;
        rows |= row_bits(~EQ(some, (vi)(0))) << row;
    }
    return (uint2)(row_or(any), rows);
}

// The rectangle around those rays; false if there are none.
inline int around_rays(global const int *rays, int2 open, Rectangle *over)
{
    const uint2 places = places_of(rays, open);
    if (!places.y) return 0;
    *over = rectangle_of(lowest(places.x), 31 - clz(places.x), lowest(places.y), 31 - clz(places.y));
    return 1;
}

// Add the part that lies beyond the last; false, and without it, where they are too many.
inline int add_part(global Parts *parts)
{
    global Part *added = parts->of + parts->count;
    vi met = 0, left = 0;
    for (int row = 0; row < BLOCK; row += LANES) met |= VLOAD(added->rays + row) & ~VLOAD(parts->open + row);
    int lost = 0;
    if (row_any(met)) {
        if (added->near > parts->far)
            for (int row = 0; row < BLOCK; row += LANES) VSTORE(VLOAD(added->rays + row) & VLOAD(parts->open + row), added->rays + row);
        else
            for (int k = 0; k < parts->count; ++k) lost |= divide_rays(added, parts->of + k) << k;
    }
    for (int row = 0; row < BLOCK; row += LANES) {
        const vi rays = VLOAD(added->rays + row);
        left |= rays;
        VSTORE(VLOAD(parts->open + row) & ~rays, parts->open + row);
    }
    if (!row_any(left)) return 1;
    parts->near = min(parts->near, added->near);
    parts->far = max(parts->far, added->far);
    const int last = parts->count++;
    if (lost) {
        parts->count = 0;
        for (int k = 0; k <= last; ++k)
            if (!(lost >> k & 1)) {
                if (k > parts->count) parts->of[parts->count] = parts->of[k];
                ++parts->count;
            }
    }
    if (parts->count <= PARTS) return 1;
    parts->count = PARTS;
    return 0;
}

// Whether all rays of the block belong to some part.
inline int fill_block(global const Parts *parts)
{
    vi open = 0;
    for (int row = 0; row < BLOCK; row += LANES) open |= VLOAD(parts->open + row);
    return !row_any(open);
}

#else
#define PARTS_WORDS 0
typedef void Parts;
#endif

#endif
