// The occluder cache: what may stand before a triangle, found once for many blocks.
//
// Blocks of a packet lie side by side, and most share their triangles with their neighbours.  What
// may stand between a light and all that one element's part of the packet sees of a triangle is
// gathered when the first block asks, and its affine functions over those rays are kept; often
// there is nothing.  An entry depends on nothing but the packet, the triangle and the light: which
// block asked first, and what else is traced, changes no bit of it.
#pragma once
#include "receiver.cl"

#define ENTRIES 256
#define POOL 1024           // occluders of all entries
#define MOST_OCCLUDERS 128  // of one entry; with more, the block is shadowed as a whole

// Counts of an entry without occluders.  ALL_DARK: one occluder shadows every ray that meets the
// triangle.  NOT_KEPT: there are too many occluders, or the bounds over the element's rays are too
// wide for one block's.
enum { ALL_DARK = -2, NOT_KEPT = -1 };

typedef struct {
    int triangle, light;  // -1: empty
    int first, count;     // the first row of LANES in the pool; occluders, or one of the above
} CacheEntry;

// LANES occluders: the terms of four affine functions.
typedef struct { float of[4][3][LANES]; } OccluderRow;

typedef struct OccluderCache {
    CacheEntry entry[ENTRIES];
    global OccluderRow *pool;  // (POOL / LANES,)
    int used;            // rows of the pool
    int element;         // whose rays, of the packet's elements; -1: none
    Bundle rays;         // of that element's part of the packet, as if they were one block
} OccluderCache;

inline void clear_cache(OccluderCache *c)
{
    for (int k = 0; k < ENTRIES; ++k) c->entry[k].triangle = -1;
    c->used = 0;
}

// To be called before a block's shadows are asked for.
inline void enter_element(const Packet *p, int block, OccluderCache *c)
{
    const int element = p->rays->block[block].element;
    if (c->element == element) return;
    c->element = element;
    c->rays = element_bundle(p, block);
    clear_cache(c);
}

// Where along one axis rays may meet a triangle whose corners are at `at` and depths z, in columns
// from the middle: the first and the last.  Of the middle ray o and d are origin and direction, s
// and t their steps, of which there are `half_extent` to either side.
inline float2 columns_at(float o, float d, float s, float t, float half_extent, float3 at, float3 z)
{
    const float3 pitch = fma(z, t, s), along = o + z * d;
    const float3 centre = fabs(at) + fabs(o) + fabs(z * d);
    const float3 error = COLUMN_SLACK * fma(fabs(z), half_extent * fabs(t),
                                            centre + half_extent * fabs(s));
    // Rays of a pixel cross where it is in focus, and nothing is met behind the lens.
    const int cross = least_of(pitch.xyzz) <= 0.0f && most_of(pitch.xyzz) >= 0.0f;
    if (cross || least_of(z.xyzz) <= 0.0f) return (float2)(-half_extent, half_extent);
    const float3 column = (at - along) / pitch, slack = error / fabs(pitch);
    const float3 low = column - slack, high = column + slack;
    const float2 ends = (float2)(least_of(low.xyzz), most_of(high.xyzz));
    return clamp(ends, -half_extent, half_extent);
}

// Around the rays of an element that may meet a triangle of corners v.
inline Rectangle rays_at(const Bundle *r, const float3 *v)
{
    const float3 x = (float3)(v[0].x, v[1].x, v[2].x), y = (float3)(v[0].y, v[1].y, v[2].y);
    const float3 z = (float3)(v[0].z, v[1].z, v[2].z);
    const float2 across = columns_at(r->ox, r->dx, r->sx, r->tx, r->half_extent, x, z);
    const float2 down = columns_at(r->oy, r->dy, r->sy, r->ty, r->half_extent, y, z);
    return (Rectangle){0.5f * (across.x + across.y), 0.5f * (down.x + down.y),
                       0.5f * (across.y - across.x), 0.5f * (down.y - down.x)};
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

// Bounds of where they meet it: those of the triangle, and of the rays at the triangle's depths.
inline Box hits_at(const Bundle *r, const float3 *v, global const PlaneEquations *planes,
                   Rectangle over)
{
    const float3 low = min(v[0], min(v[1], v[2])), high = max(v[0], max(v[1], v[2]));
    const float3 slack = hit_slack(r, v, least_over(planes->denominator, over));
    const float2 exact = quotient_range(planes->numerator, planes->denominator, over);
    const float near = max(max(low.z, 0.0f), exact.x);
    Box box = bundle_box(r, over, (float2)(near, max(near, min(high.z, exact.y))));
    for (int k = 0; k < 3; ++k) {
        // Rounding apart, both hold what is seen.
        const float lo = min(max(box.lo[k], axis(low, k)), axis(high, k));
        box.hi[k] = max(min(box.hi[k], axis(high, k)), lo) + axis(slack, k);
        box.lo[k] = lo - axis(slack, k);
    }
    return box;
}

// Whether affine functions over an element's rays will do for a block's: rounding is that of the
// largest weight, and what is excluded near the surface a multiple of each.
inline int evenly_weighted(Affine weight, Rectangle at)
{
    const float middle = weight.of[ONE] + at.x * weight.of[X] + at.y * weight.of[Y];
    const float spread = at.half_width * fabs(weight.of[X]) + at.half_height * fabs(weight.of[Y]);
    return middle - spread > 0.125f * max(middle + spread, weight.of[ONE]);
}

// A half space that holds no occluders of a triangle: n . P + c >= 0 for points P relative to the
// apex that are behind the triangle's plane, or before it by less than the margin.
typedef struct { float3 n; float c; } Behind;

inline Behind behind_plane(const float3 *v, const ShadowRays *r)
{
    const float3 at = v[0] - r->apex, n = cross_product(v[1] - v[0], v[2] - v[0]);
    const float offset = inner_product(n, at);
    const float side = r->is_point ? offset : -inner_product(n, r->towards);
    const float sign = side < 0.0f ? -1.0f : 1.0f;
    const float margin = SHADOW_MARGIN * inner_product(fabs(n), fabs(at) + r->size);
    return (Behind){sign * n, margin - sign * offset};
}

inline vi lie_behind(const Behind *b, const Occluders *o)
{
    vf least = FAR;
    for (int k = 0; k < 3; ++k) least = min(least, dot3(o->v[k], spread3(b->n)) + b->c);
    return GE(least, (vf)(0.0f));
}

// An entry while it is made.
typedef struct {
    CacheEntry *entry;
    ShadowRays rays;
    Receiver receiver;
    Rectangle over;  // around all rays that may meet the triangle
    Behind behind;
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

// Keep those of LANES triangles that can darken a ray.  False once no more are wanted: one of them
// darkens every ray, or they are too many.
inline int keep_occluders(const Shadows *s, const NewEntry *n, int leaf, int lane)
{
    global const int *ids = leaf_numbers(s->tree, leaf, lane);
    WideAffine e[4];
    Occluders o;
    load_corners(leaf_corners(s->tree, leaf, lane), n->rays.apex, o.v);
    const vi own = EQ(VLOAD(ids), (vi)(n->entry->triangle)) |
                   are_of_light(n->rays.light_triangles, ids);
    vi may = ~(lie_behind(&n->behind, &o) | own), all = -1;
    if (!row_any(may)) return 1;
    e[3] = project_plane(&n->receiver, face_plane(&n->rays, &o, &may));
    classify_occluders(e[3], &n->over, &may, &all);
    for (int k = 2; k >= 0; --k) {
        if (!row_any(may)) return 1;
        e[k] = project_plane(&n->receiver, edge_plane(&n->rays, &o, k));
        classify_occluders(e[k], &n->over, &may, &all);
    }
    const uint keep = row_bits(may);
    if (row_any(all & may)) n->entry->count = ALL_DARK;
    else if (n->entry->count + popcount(keep) > MOST_OCCLUDERS) n->entry->count = NOT_KEPT;
    if (n->entry->count < 0) return 0;
    for (uint left = keep; left; left &= left - 1)
        keep_occluder(s->cache, n->entry, e, lowest(left));
    return 1;
}

// Gather what may stand between light `number` and all that the packet sees of a triangle.
inline void make_entry(Shadows *s, int triangle, int number, CacheEntry *entry)
{
    OccluderCache *c = s->cache;
    global PlaneEquations *planes = s->element_planes;
    if (c->used + MOST_OCCLUDERS / LANES > POOL / LANES) clear_cache(c);
    const TriangleRow one = {1, {triangle}};
    set_up_planes(s->scene, &c->rays, &one, planes);
    const float3 v[3] = {corner(s->scene, triangle, 0), corner(s->scene, triangle, 1),
                         corner(s->scene, triangle, 2)};
    const Rectangle over = rays_at(&c->rays, v);
    const int even = evenly_weighted(planes->denominator, over);
    *entry = (CacheEntry){triangle, number, c->used, even ? 0 : NOT_KEPT};
    if (!even) return;
    const Box box = hits_at(&c->rays, v, planes, over);
    const ShadowRays rays = make_shadow_rays(shadow_light(s->scene, number), &box);
    const NewEntry n = {entry, rays, make_receiver(&c->rays, planes, rays.apex), over,
                        behind_plane(v, &rays)};
    Stack stack;
    start_walk(&stack);
    for (int leaf; (leaf = next_hiding(s->tree, &rays, &stack)) >= 0;)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
            if (!keep_occluders(s, &n, leaf, lane)) return;
    c->used += (entry->count + LANES - 1) / LANES;
}

// Darken what lies behind an entry's occluders; false once no ray is lit.
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
