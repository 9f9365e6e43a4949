// The occluder cache: what may stand before a triangle, found once for many blocks.
//
// Blocks of a packet lie side by side, and most share their triangles with their neighbours.  What
// may stand between a light and all that one element's part of the packet sees of a triangle is
// listed when the first block needs it, and its affine functions over those rays are kept; often
// there is nothing.  An entry depends on nothing but the packet, the triangle and the light: which
// block needs it first, and what else is traced, changes no bit of it.
#pragma once
#include "shadow_mask.cl"

#define ENTRIES 256
#define POOL 1024           // occluders of all entries
#define MOST_OCCLUDERS 128  // of one entry; with more, the block is shadowed as a whole

// The count of an entry of too many occluders, or where the bounds over the element's rays are too
// wide for one block's.
#define NOT_KEPT -1

typedef struct {
    int triangle, light;  // -1: empty
    int first, count;     // the first row of LANES in the pool; occluders, or NOT_KEPT
} CacheEntry;

// LANES occluders: the terms of four affine functions.
typedef struct { float of[4][3][LANES]; } OccluderRow;

typedef struct OccluderCache {
    CacheEntry entry[ENTRIES];
    global OccluderRow *pool;  // (POOL / LANES,)
    int used;            // rows of the pool
    int element;         // whose rays, of the packet's elements; -1: none
    Bundle bundle;       // of that element's part of the packet, as if they were one block
} OccluderCache;

inline void clear_cache(OccluderCache *c)
{
    for (int k = 0; k < ENTRIES; ++k) c->entry[k].triangle = -1;
    c->used = 0;
}

// To be called before a block's entries are used.
inline void enter_element(const Packet *p, int block, OccluderCache *c)
{
    const int element = p->rays->block[block].element;
    if (c->element == element) return;
    c->element = element;
    c->bundle = element_bundle(p, block);
    clear_cache(c);
}

// A hit point times the denominator of its depth, the weight, is affine over the rays of an element
// that hit one triangle: rays of a pixel meet in its focus point, rays of a view in the lens
// sample, and either way the map to the triangle's plane is a homography.  So the affine functions
// of occluders are affine over the rays, too, and are tested as triangles are.
//
// The receiver's hit points relative to the apex, times the weight, and the weight, which is
// positive over the rectangle: of each the terms ONE, X and Y.
typedef struct { float3 point[3]; Affine weight; } Receiver;

inline Receiver make_receiver(const Bundle *r, global const PlaneEquations *p)
{
    const Affine z = p->numerator, w = p->denominator;
    const float3 o = (float3)(r->ox, r->oy, 0.0f), d = (float3)(r->dx, r->dy, 1.0f);
    const float3 sx = (float3)(r->sx, 0.0f, 0.0f), tx = (float3)(r->tx, 0.0f, 0.0f);
    const float3 sy = (float3)(0.0f, r->sy, 0.0f), ty = (float3)(0.0f, r->ty, 0.0f);
    Receiver f = {.weight = w};
    f.point[ONE] = o * w.of[ONE] + z.of[ONE] * d;
    f.point[X] = sx * w.of[ONE] + o * w.of[X] + z.of[X] * d + z.of[ONE] * tx;
    f.point[Y] = sy * w.of[ONE] + o * w.of[Y] + z.of[Y] * d + z.of[ONE] * ty;
    return f;
}

// The affine function n . P + c of hit points P, times the weight.
inline WideAffine project_half_space(const Receiver *f, HalfSpace p)
{
    WideAffine e;
    for (int k = 0; k < 3; ++k) {
        const float3 at = f->point[k];
        const vf last = fma(p.n.z, (vf)(at.z), p.c * f->weight.of[k]);
        e.of[k] = fma(p.n.x, (vf)(at.x), fma(p.n.y, (vf)(at.y), last));
    }
    return e;
}

// The first and last column, from the centre, of rays that may hit a triangle; or rows, along y.
inline float2 columns_at(Axis a)
{
    const float most = a.half_extent;
    vf lo, hi;
    if (!row_any(find_span(&a, COLUMN_SLACK, 0, &lo, &hi))) return (float2)(-most, most);
    return clamp((float2)(row_min(lo), row_max(hi)) - most, -most, most);
}

// Around the rays of an element that may hit a triangle of corners v.
inline Rectangle rays_at(const Bundle *r, const float3 *v)
{
    Vec sheared[3] = {spread3(v[0]), spread3(v[1]), spread3(v[2])};
    shear_corners(r, sheared);
    const float2 x = columns_at(make_axis(r, sheared, 0)), y = columns_at(make_axis(r, sheared, 1));
    return (Rectangle){0.5f * (x.x + x.y), 0.5f * (y.x + y.y),
                       0.5f * (x.y - x.x), 0.5f * (y.y - y.x)};
}

// A bound of the rounding errors of hit points on a triangle of corners v, whose n . D is `least`
// or more: depth is n . P / n . D.
inline float3 hit_slack(const Bundle *r, const float3 *v, float least)
{
    const float2 origin = fabs((float2)(r->ox, r->oy)) +
                          r->half_extent * fabs((float2)(r->sx, r->sy));
    const float2 slope = fabs((float2)(r->dx, r->dy)) +
                         r->half_extent * fabs((float2)(r->tx, r->ty));
    float3 most = max(fabs(v[0]), max(fabs(v[1]), fabs(v[2])));
    most.xy += origin + most.z * slope;
    const float3 a = fabs(v[1] - v[0]), b = fabs(v[2] - v[0]);
    const float depth = inner_product(a.yzx * b.zxy + a.zxy * b.yzx, most) / least;
    return HIT_SLACK * (float3)(most.xy + depth * slope, depth);
}

// The box of these hit points: of the triangle, cut to what the rays `over` it see.
inline Box hits_at(const Bundle *r, const float3 *v, const Receiver *receiver, Rectangle over)
{
    const float3 low = min(v[0], min(v[1], v[2])), high = max(v[0], max(v[1], v[2]));
    const float3 slack = hit_slack(r, v, least_over(receiver->weight, over));
    const float3 *point = receiver->point;
    Box box;
    for (int k = 0; k < 3; ++k) {
        const Affine at = {{axis(point[ONE], k), axis(point[X], k), axis(point[Y], k)}};
        const float2 seen = quotient_range(at, receiver->weight, over);
        // Rounding apart, both hold what is seen.
        const float lo = min(max(seen.x, axis(low, k)), axis(high, k));
        box.hi[k] = max(min(seen.y, axis(high, k)), lo) + axis(slack, k);
        box.lo[k] = lo - axis(slack, k);
    }
    return box;
}

// Whether affine functions over an element's rays will do for a block's: rounding is that of the
// largest weight, and what is excluded near the surface a multiple of each.
inline int evenly_weighted(Affine weight, Rectangle at)
{
    const float4 corners = corner_values(weight, at);
    return least_of(corners) > 0.125f * max(most_of(corners), weight.of[ONE]);
}

// An entry while it is made.
typedef struct {
    CacheEntry *entry;
    ShadowRays rays;
    Receiver receiver;
    Rectangle over;  // around all rays that may hit the triangle
} NewEntry;

// Keep occluder `lane` of those of affine functions `e`.
inline void keep_occluder(OccluderCache *c, CacheEntry *entry, const WideAffine *e, int lane)
{
    const int at = entry->count++;
    global OccluderRow *to = c->pool + entry->first + at / LANES;
    for (int k = 0; k < 4; ++k)
        for (int term = 0; term < 3; ++term)
            to->of[k][term][at % LANES] = ((const float *)&e[k].of[term])[lane];
}

// Store which of LANES triangles may occlude a ray; false if they do not fit.
inline int keep_occluders(const Shadows *s, const NewEntry *n, int leaf, int lane)
{
    global const int *ids = triangle_ids(s->tree, leaf, lane);
    WideAffine e[4];
    Occluders o;
    load_corners(leaf_corners(s->tree, leaf, lane), n->rays.apex, o.v);
    vi may = ~(EQ(VLOAD(ids), (vi)(n->entry->triangle)) |
               are_of_light(n->rays.light_triangles, ids));
    vi all = -1;
#pragma unroll
    for (int k = 3; k >= 0 && row_any(may); --k) {
        const HalfSpace f = k == 3 ? face_plane(&n->rays, &o, &may) : edge_plane(&n->rays, &o, k);
        e[k] = project_half_space(&n->receiver, f);
        classify_occluders(e[k], &n->over, &may, &all);
    }
    const uint keep = row_bits(may);
    if (n->entry->count + popcount(keep) > MOST_OCCLUDERS) n->entry->count = NOT_KEPT;
    if (n->entry->count == NOT_KEPT) return 0;
    for (uint left = keep; left; left &= left - 1)
        keep_occluder(s->cache, n->entry, e, lowest(left));
    return 1;
}

// List the triangles that may stand between light `number` and what the packet sees of a triangle.
inline void make_entry(Shadows *s, int triangle, int number, CacheEntry *entry)
{
    OccluderCache *c = s->cache;
    global PlaneEquations *equations = s->element_equations;
    if (c->used + MOST_OCCLUDERS / LANES > POOL / LANES) clear_cache(c);
    const TriangleRow one = {1, {triangle}};
    set_up_equations(s->scene, &c->bundle, &one, equations);
    const float3 v[3] = {corner(s->scene, triangle, 0), corner(s->scene, triangle, 1),
                         corner(s->scene, triangle, 2)};
    const Rectangle over = rays_at(&c->bundle, v);
    const int even = evenly_weighted(equations->denominator, over);
    *entry = (CacheEntry){triangle, number, c->used, even ? 0 : NOT_KEPT};
    if (!even) return;
    Receiver receiver = make_receiver(&c->bundle, equations);
    const Box box = hits_at(&c->bundle, v, &receiver, over);
    const ShadowRays rays = make_shadow_rays(shadow_light(s->scene, number), &box);
    for (int k = 0; k < 3; ++k) receiver.point[k] -= rays.apex * receiver.weight.of[k];
    const NewEntry n = {entry, rays, receiver, over};
    Stack stack;
    start_walk(&stack);
    for (int leaf; (leaf = next_hiding(s->tree, &rays, &stack)) >= 0;)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
            if (!keep_occluders(s, &n, leaf, lane)) return;
    c->used += (entry->count + LANES - 1) / LANES;
}

// Mask out the rays behind an entry's occluders; false once no ray is lit.
inline int cast_entry(const OccluderCache *c, const CacheEntry *entry, ShadowMask *m)
{
    for (int at = 0; at < entry->count; at += LANES) {
        global const OccluderRow *from = c->pool + entry->first + at / LANES;
        WideAffine e[4];
        for (int k = 0; k < 4; ++k)
            for (int term = 0; term < 3; ++term) e[k].of[term] = VLOAD(from->of[k][term]);
        if (!cast_occluders(e, LT(IOTA, (vf)(entry->count - at)), m)) return 0;
    }
    return 1;
}
