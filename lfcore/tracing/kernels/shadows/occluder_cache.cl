// The occluder cache: what may stand before a triangle, found once for many blocks.
//
// Blocks of a packet lie side by side, and most share their triangles with their neighbours.  What
// may stand between a light and all that one element's part of the packet sees of a triangle is
// gathered when the first block asks, and its forms over those rays are kept; often there is
// nothing.  An entry depends on nothing but the packet, the triangle and the light: which block
// asked first, and what else is traced, changes no bit of it.
#ifndef LFCORE_OCCLUDER_CACHE_CL
#define LFCORE_OCCLUDER_CACHE_CL
#include "receiver.cl"

#define ENTRIES 256
#define FORM_WORDS 12       // of an occluder: four forms of three terms
#define POOL 1024           // occluders of all entries
#define MOST_OCCLUDERS 128  // and of one: more are culled block by block
#define POOL_WORDS (FORM_WORDS * POOL)

// No ray that meets the triangle sees the light; there are too many occluders to keep, or forms
// over the element's rays would not do for a block's.
enum { ALL_DARK = -2, NOT_KEPT = -1 };

typedef struct {
    int triangle, light;  // -1: empty
    int first, rows;      // rows of LANES occluders in the pool, or one of the above
} CacheEntry;

typedef struct OccluderCache {
    CacheEntry entry[ENTRIES];
    global float *pool;  // (POOL / LANES, FORM_WORDS, LANES)
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
    if (c->element == block / ELEMENT_BLOCKS) return;
    c->element = block / ELEMENT_BLOCKS;
    c->rays = element_bundle(p, block);
    clear_cache(c);
}

// Where along one axis rays may meet a triangle whose corners are at `at` and depths z, in columns
// from the middle: the first and the last.  Of the middle ray o and d are origin and direction, s
// and t their steps.
inline float2 columns_at(float o, float d, float s, float t, float3 at, float3 z)
{
    const float3 pitch = fma(z, t, s), along = o + z * d;
    const float3 noise = HIT_SLACK * (fabs(at) + fabs(o) + fabs(z * d));
    // Rays of a pixel cross where it is in focus, and nothing is met behind the lens.
    const int cross = least_of(pitch.xyzz) <= 0.0f && most_of(pitch.xyzz) >= 0.0f;
    if (cross || least_of(z.xyzz) <= 0.0f) return (float2)(-ELEMENT_HALF, ELEMENT_HALF);
    const float3 column = (at - along) / pitch, slack = noise / fabs(pitch) + SAMPLE_SLACK;
    const float3 low = column - slack, high = column + slack;
    const float2 ends = (float2)(least_of(low.xyzz), most_of(high.xyzz));
    return clamp(ends, -ELEMENT_HALF, ELEMENT_HALF);
}

// Rays of an element that may meet a triangle, and bounds of their hit points.
typedef struct {
    Rectangle over;
    Box box;
} SeenTriangle;

inline SeenTriangle see_triangle(const Scene *s, const Bundle *r, int triangle,
                                 global const PlaneEquations *planes)
{
    const float3 p = corner(s, triangle, 0), q = corner(s, triangle, 1), w = corner(s, triangle, 2);
    const float3 z = (float3)(p.z, q.z, w.z);
    const float3 x = (float3)(p.x, q.x, w.x), y = (float3)(p.y, q.y, w.y);
    const float2 across = columns_at(r->ox, r->dx, r->sx, r->tx, x, z);
    const float2 down = columns_at(r->oy, r->dy, r->sy, r->ty, y, z);
    const Rectangle over = {0.5f * (across.x + across.y), 0.5f * (down.x + down.y),
                            0.5f * (across.y - across.x), 0.5f * (down.y - down.x)};
    const float3 slack = HIT_SLACK * max(fabs(p), max(fabs(q), fabs(w)));
    const float3 low = min(p, min(q, w)) - slack, high = max(p, max(q, w)) + slack;
    float2 depths = (float2)(max(low.z, 0.0f), high.z);
    if (is_one_sided(planes->denominator, over)) {
        const float2 exact = quotient_range(planes->numerator, planes->denominator, over);
        depths.x = max(depths.x, exact.x);
        depths.y = max(depths.x, min(depths.y, exact.y));
    }
    SeenTriangle seen = {over, bundle_box(r, over, depths)};
    for (int k = 0; k < 2; ++k) {
        // Rounding apart, both hold what is seen.
        seen.box.lo[k] = min(max(seen.box.lo[k], axis(low, k)), axis(high, k));
        seen.box.hi[k] = max(min(seen.box.hi[k], axis(high, k)), seen.box.lo[k]);
    }
    return seen;
}

// Whether forms over an element's rays will do for a block's: rounding is that of the largest
// weight, and what is excluded near the surface a multiple of each.
inline int evenly_weighted(Form weight, Rectangle at)
{
    const float middle = weight.of[ONE] + at.x * weight.of[X] + at.y * weight.of[Y];
    const float spread = at.wide * fabs(weight.of[X]) + at.high * fabs(weight.of[Y]);
    return middle - spread > 0.125f * max(middle + spread, weight.of[ONE]);
}

// What is not negative at a point relative to the apex, n . P + c, where that can darken nothing:
// behind a triangle's plane, or before it by less than what is excluded near surfaces.
typedef struct { float3 n; float c; } Behind;

inline Behind behind_plane(const Scene *s, int triangle, const ShadowRays *r)
{
    const float3 p = corner(s, triangle, 0), at = p - r->apex;
    const float3 n = cross_product(corner(s, triangle, 1) - p, corner(s, triangle, 2) - p);
    const float offset = inner_product(n, at);
    const float side = r->is_point ? offset : -inner_product(n, r->towards);
    const float sign = side < 0.0f ? -1.0f : 1.0f;
    const float margin = SHADOW_MARGIN * inner_product(fabs(n), fabs(at) + r->size);
    const Behind b = {sign * n, margin - sign * offset};
    return b;
}

inline vi lie_behind(const Behind *b, const Occluders *o)
{
    vf least = FAR;
    for (int k = 0; k < 3; ++k) least = min(least, dot3(o->v[k], spread3(b->n)) + b->c);
    return GE(least, (vf)(0.0f));
}

// An entry while it is made.
typedef struct {
    int triangle;
    ShadowRays rays;
    Receiver receiver;
    Rectangle over;   // around all rays that may meet the triangle
    Behind behind;
    int count;        // of occluders
} NewEntry;

// Keep occluder `lane` of those of forms `e`, or one that darkens nothing.
inline void keep_occluder(OccluderCache *c, int at, const Forms *e, int lane)
{
    global float *to = c->pool + (c->used + at / LANES) * FORM_WORDS * LANES + at % LANES;
    for (int k = 0; k < FORM_WORDS; ++k) {
        const float dark_nowhere = k % 3 ? 0.0f : -1.0f;
        to[k * LANES] = lane < 0 ? dark_nowhere : ((const float *)&e[k / 3].of[k % 3])[lane];
    }
}

// Keep those of LANES triangles that can darken a ray.  False once no more are wanted: one of them
// darkens every ray, or they are too many; `rows` receives which.
inline int keep_occluders(const Shadows *s, NewEntry *n, int leaf, int lane, int *rows)
{
    global const int *ids = leaf_numbers(s->tree, leaf, lane);
    Forms e[4];
    Occluders o;
    place_occluders(&n->rays, leaf_corners(s->tree, leaf, lane), &o);
    const vi own = EQ(VLOAD(ids), (vi)(n->triangle)) | are_own(n->rays.own, ids);
    vi may = ~(lie_behind(&n->behind, &o) | own), all = -1;
    if (!row_any(may)) return 1;
    e[3] = project_plane(&n->receiver, face_plane(&n->rays, &o, &may));
    sift_occluders(e[3], &n->over, &may, &all);
    for (int k = 2; k >= 0; --k) {
        if (!row_any(may)) return 1;
        e[k] = project_plane(&n->receiver, edge_plane(&n->rays, &o, k));
        sift_occluders(e[k], &n->over, &may, &all);
    }
    const uint keep = row_bits(may);
    const int many = n->count + popcount(keep) > MOST_OCCLUDERS;
    *rows = row_any(all & may) ? ALL_DARK : many ? NOT_KEPT : 0;
    if (*rows) return 0;
    for (uint left = keep; left; left &= left - 1)
        keep_occluder(s->cache, n->count++, e, lowest(left));
    return 1;
}

// Gather what stands before a new entry's triangle; `box` bounds its hit points.
inline int gather_occluders(Shadows *s, int number, const Box *box, NewEntry *n)
{
    NearbyLeaves nearby;
    int rows = 0;
    for (start_nearby(s, number, box, &nearby); next_nearby(s, &nearby);)
        for (int k = 0; k < s->nearby.count; ++k)
            for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
                if (!keep_occluders(s, n, s->nearby.leaf[k], lane, &rows)) return rows;
    return (n->count + LANES - 1) / LANES;
}

inline void make_entry(Shadows *s, int triangle, int number, CacheEntry *entry)
{
    OccluderCache *c = s->cache;
    global const float *light = shadow_light(s->scene, number);
    global PlaneEquations *planes = s->element_planes;
    set_up_planes(s->scene, &c->rays, triangle, 0.0f, planes);
    const SeenTriangle seen = see_triangle(s->scene, &c->rays, triangle, planes);
    NewEntry n;
    n.triangle = triangle;
    n.rays = make_shadow_rays(light, &seen.box);
    n.over = seen.over;
    n.count = 0;
    entry->triangle = triangle;
    entry->light = number;
    entry->first = c->used;
    entry->rows = NOT_KEPT;
    if (!evenly_weighted(planes->denominator, seen.over)) return;
    entry->rows = ALL_DARK;
    if (turned_away(planes, &c->rays, seen.over, light, &seen.box)) return;
    n.receiver = make_receiver(&c->rays, planes, n.rays.apex);
    n.behind = behind_plane(s->scene, triangle, &n.rays);
    entry->rows = gather_occluders(s, number, &seen.box, &n);
    if (entry->rows < 0) return;
    for (; n.count % LANES; ++n.count) keep_occluder(c, n.count, 0, -1);
    c->used += entry->rows;
}

// The entry of what the packet sees of a triangle, in light `number`.
inline const CacheEntry *find_entry(Shadows *s, int triangle, int number)
{
    OccluderCache *c = s->cache;
    const uint key = (uint)triangle * (uint)s->scene->numbers->shadow_lights + number;
    CacheEntry *entry = c->entry + key % ENTRIES;
    if (entry->triangle == triangle && entry->light == number) return entry;
    if (c->used + MOST_OCCLUDERS / LANES > POOL / LANES) clear_cache(c);
    make_entry(s, triangle, number, entry);
    return entry;
}

// Darken what lies behind an entry's occluders.
inline void cast_entry(const OccluderCache *c, const CacheEntry *entry, ShadowMask *m)
{
    for (int row = entry->first; row < entry->first + entry->rows; ++row) {
        global const float *at = c->pool + row * FORM_WORDS * LANES;
        Forms e[4];
        for (int k = 0; k < FORM_WORDS; ++k) e[k / 3].of[k % 3] = VLOAD(at + k * LANES);
        if (!cast_forms(e, (vi)(-1), m)) return;
    }
}

#endif
