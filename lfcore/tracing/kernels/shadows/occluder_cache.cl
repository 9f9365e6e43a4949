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

// Where along one axis rays may meet a triangle: `o` and `d` are the middle ray's, `s` and `t` the
// steps.
typedef struct { float o, d, s, t; } AxisRays;

// In columns from the middle, of `most` to either side: the first and the last.
inline float2 columns_at(AxisRays r, float3 at, float3 z, float most)
{
    const float3 pitch = fma(z, r.t, r.s), along = r.o + z * r.d;
    const float3 noise = HIT_SLACK * (fabs(at) + fabs(r.o) + fabs(z * r.d));
    const float least = min(pitch.x, min(pitch.y, pitch.z));
    const float largest = max(pitch.x, max(pitch.y, pitch.z));
    // Rays of a pixel cross where it is in focus, and nothing is met behind the lens.
    const int cross = least <= 0.0f && largest >= 0.0f;
    if (cross || min(z.x, min(z.y, z.z)) <= 0.0f) return (float2)(-most, most);
    const float3 column = (at - along) / pitch, slack = noise / fabs(pitch) + SAMPLE_SLACK;
    const float3 low = column - slack, high = column + slack;
    const float first = min(low.x, min(low.y, low.z)), last = max(high.x, max(high.y, high.z));
    return clamp((float2)(first, last), -most, most);
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
    const AxisRays x = {r->ox, r->dx, r->sx, r->tx}, y = {r->oy, r->dy, r->sy, r->ty};
    const float2 across = columns_at(x, (float3)(p.x, q.x, w.x), z, ELEMENT_HALF);
    const float2 down = columns_at(y, (float3)(p.y, q.y, w.y), z, ELEMENT_HALF);
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
    const float l[2] = {low.x, low.y}, h[2] = {high.x, high.y};
    for (int k = 0; k < 2; ++k) {
        // Rounding apart, both hold what is seen.
        seen.box.lo[k] = min(max(seen.box.lo[k], l[k]), h[k]);
        seen.box.hi[k] = max(min(seen.box.hi[k], h[k]), seen.box.lo[k]);
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
inline void keep_occluder(OccluderCache *c, int at, const RayForm *e, int lane)
{
    global float *to = c->pool + (c->used + at / LANES) * FORM_WORDS * LANES + at % LANES;
    for (int k = 0; k < FORM_WORDS; ++k) {
        const float dark_nowhere = k % 3 ? 0.0f : -1.0f;
        to[k * LANES] = lane < 0 ? dark_nowhere : ((const float *)e)[k * LANES + lane];
    }
}

// Keep those of LANES triangles that can darken a ray.  False once no more are wanted: one of them
// darkens every ray, or they are too many; `rows` receives which.
inline int keep_occluders(OccluderCache *c, NewEntry *n, global const float *leaf,
                          global const int *ids,
                          int *rows)
{
    RayForm e[4];
    Occluders o;
    place_occluders(&n->rays, leaf, &o);
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
    for (uint left = keep; left; left &= left - 1) keep_occluder(c, n->count++, e, lowest(left));
    return 1;
}

// Gather what stands before a new entry's triangle; `box` bounds its hit points.
inline int gather_occluders(Shadows *s, int number, const Box *box, NewEntry *n)
{
    NearbyLeaves nearby;
    int rows = 0;
    for (start_nearby(s, number, box->lo, box->hi, &nearby); next_nearby(s, &nearby);)
        for (int k = 0; k < s->nearby.count; ++k)
            for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
                global const float *corners = leaf_corners(s->tree, s->nearby.leaf[k], lane);
                global const int *ids = leaf_numbers(s->tree, s->nearby.leaf[k], lane);
                if (!keep_occluders(s->cache, n, corners, ids, &rows)) return rows;
            }
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
    n.rays = make_shadow_rays(light, seen.box.lo, seen.box.hi);
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
        RayForm e[4];
        for (int k = 0; k < 4; ++k, at += 3 * LANES) {
            const RayForm form = {VLOAD(at), VLOAD(at + LANES), VLOAD(at + 2 * LANES)};
            e[k] = form;
        }
        if (!cast_forms(e, (vi)(-1), m)) return;
    }
}

#endif
