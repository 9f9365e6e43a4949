// Screens: the occluders of one triangle's rays, found once for many blocks.
//
// Blocks of a beam lie side by side, and most share their triangles with their neighbours.  What may stand between
// the light and all that one element's part of the beam sees of a triangle is gathered when the first block asks, and
// its forms are set up for good; often there is nothing.  A screen depends on nothing but the beam, the triangle and the light: which block or beam asked
// first, and what else is traced, changes no bit of it.
#ifndef LFCORE_SCREENS_CL
#define LFCORE_SCREENS_CL
#include "homography.cl"
#include "beam.cl"

#if OUTER == 1
#define SCREENS 256
#define OCCLUDER_WORDS 12
#define POOL 1024           // occluders of all screens
#define SCREEN_LIMIT 128    // and of one: more are culled block by block

// No ray that meets the triangle sees the light; occluders are culled block by block, or beam by beam.
enum { ALL_DARK = -2, NO_SCREEN = -1 };

typedef struct {
    int key;                // triangle and light; -1: none
    int first, rows;        // rows of LANES occluders in the pool, or one of these
} Screen;

typedef struct {
    Screen of[SCREENS];
    global float *pool;     // (rows, OCCLUDER_WORDS, LANES) four forms of each occluder
    int used, size, limit;  // rows of the pool; occluders that one screen may have
} ScreenSet;

typedef struct {
    ScreenSet part;         // before an element's rays in the beam
    int element;            // of the beam, whose rays are painted
    Bundle bundle;          // those that forms are counted from the middle of, as if they were one block
    Rectangle all;          // all of them
    float2 block;           // where the block that is painted lies among them
} Screens;

inline void clear_screens(ScreenSet *set)
{
    for (int k = 0; k < SCREENS; ++k) set->of[k].key = -1;
    set->used = 0;
}

// The place of a screen in its set: it is there, or to be made, for which there is room.
inline Screen *free_screen(ScreenSet *set, int key)
{
    Screen *screen = set->of + key % SCREENS;
    if (screen->key != key && set->used + set->limit / LANES > set->size) clear_screens(set);
    return screen;
}

// Divide `pool`, for worker's screens, none of which are there yet.
inline void make_screens(global float *pool, Screens *screens)
{
    screens->part.pool = pool;
    screens->part.size = POOL / LANES;
    screens->part.limit = SCREEN_LIMIT;
}

// To be called before a block is painted.
inline void enter_element(const Rays *rays, const BeamWork *work, int block, Screens *screens)
{
    if (screens->element != block / ELEMENT_BLOCKS) {
        screens->element = block / ELEMENT_BLOCKS;
        clear_screens(&screens->part);
        screens->bundle = element_bundle(rays, work, block);
        const Rectangle here = {0.0f, 0.0f, ELEMENT_HALF, ELEMENT_HALF};
        screens->all = here;
    }
    screens->block = block_offset(block);
}

// Where along one axis the rays lie that may meet a triangle with corners at `at` and depths `z`, in columns from the
// middle of those that pass `from` + z `along`, each `step` + z `turn` beside the one before, of `most` columns to either side
// of `here`: the middle, and half the extent.
inline float2 span_of(float3 at, float3 z, float from, float along, float step, float turn, float here, float most)
{
    const float3 pitch = fma(z, turn, step), noise = 1.0e-6f * (fabs(at) + fabs(from) + fabs(z * along));
    const int crossed = min(pitch.x, min(pitch.y, pitch.z)) <= 0.0f && max(pitch.x, max(pitch.y, pitch.z)) >= 0.0f;
    // Rays of a pixel cross where it is in focus, and nothing is met behind the lens.
    if (crossed || min(z.x, min(z.y, z.z)) <= 0.0f) return (float2)(here, most);
    const float3 column = (at - from - z * along) / pitch, slack = noise / fabs(pitch) + 0.01f;
    const float3 low = column - slack, high = column + slack;
    const float first = clamp(min(low.x, min(low.y, low.z)), here - most, here + most);
    const float last = clamp(max(high.x, max(high.y, high.z)), here - most, here + most);
    return 0.5f * (float2)(first + last, last - first);
}

// Where in a rectangle those lie that may meet triangle `id`.
inline Rectangle rays_at(const Surfaces *s, const Bundle *r, Rectangle within, int id)
{
    global const float *at = s->corners + id * 9;
    const float3 x = (float3)(at[0], at[3], at[6]), y = (float3)(at[1], at[4], at[7]), depth = (float3)(at[2], at[5], at[8]);
    const float2 across = span_of(x, depth, r->ox, r->dx, r->sx, r->tx, within.x, within.wide);
    const float2 down = span_of(y, depth, r->oy, r->dy, r->sy, r->ty, within.y, within.high);
    const Rectangle over = {across.x, down.x, across.y, down.y};
    return over;
}

// Rays that may meet a triangle, and bounds of their hit points.
typedef struct {
    Rectangle over;
    float lo[3], hi[3];
} Seen;

inline Seen see_triangle(const Surfaces *s, const Bundle *r, Rectangle within, int id, const Facet *facet)
{
    Seen seen;
    global const float *at = s->corners + id * 9;
    seen.over = rays_at(s, r, within, id);
    const float3 p = corner(at, 0), q = corner(at, 1), w = corner(at, 2), slack = 1.0e-6f * max(fabs(p), max(fabs(q), fabs(w)));
    const float3 low = min(p, min(q, w)) - slack, high = max(p, max(q, w)) + slack;
    float2 z = (float2)(max(low.z, 0.0f), high.z);
    if (one_sided_over(facet, seen.over)) {
        const float2 depths = facet_depths(facet, seen.over);
        z = (float2)(max(z.x, depths.x), max(max(z.x, depths.x), min(z.y, depths.y)));
    }
    bundle_bounds(r, seen.over, z.x, z.y, seen.lo, seen.hi);
    const float l[2] = {low.x, low.y}, h[2] = {high.x, high.y};
    for (int k = 0; k < 2; ++k) {
        // Rounding apart, both hold what is seen.
        seen.lo[k] = min(max(seen.lo[k], l[k]), h[k]);
        seen.hi[k] = max(min(seen.hi[k], h[k]), seen.lo[k]);
    }
    return seen;
}

// Whether hit points on a facet times their weight may be moved from block to block of a beam: rounding is that of the
// largest weight, and what is excluded near the surface a multiple of each.
inline int evenly_weighted(const Facet *f, Rectangle at)
{
    const float middle = f->under.c + at.x * f->under.i + at.y * f->under.j;
    const float spread = at.wide * fabs(f->under.i) + at.high * fabs(f->under.j);
    return middle - spread > 0.125f * max(middle + spread, f->under.c);
}

// What is not negative at a point relative to the apex, n . P + c, where that can darken nothing.
typedef struct { float3 n; float c; } Beyond;

// Behind a triangle's plane, or before it by less than what is excluded near surfaces.
inline Beyond behind_plane(global const float *corners, const ShadowRays *r)
{
    const float3 p = corner(corners, 0), n = cross_product(corner(corners, 1) - p, corner(corners, 2) - p), at = p - r->apex;
    const float offset = inner_product(n, at), side = r->is_point ? offset : -inner_product(n, r->towards), sign = side < 0.0f ? -1.0f : 1.0f;
    const Beyond b = {sign * n, SHADOW_MARGIN * inner_product(fabs(n), fabs(at) + r->size) - sign * offset};
    return b;
}

inline vi lie_beyond(const Beyond *b, const Occluders *o)
{
    vf least = FAR;
    for (int k = 0; k < 3; ++k)
        least = min(least, fma(o->v[k].x, (vf)(b->n.x), fma(o->v[k].y, (vf)(b->n.y), fma(o->v[k].z, (vf)(b->n.z), (vf)(b->c)))));
    return GE(least, (vf)(0.0f));
}

// What a new screen, which its set's pool ends with, is made with.
typedef struct {
    int own;                // the triangle that it is before
    ShadowRays rays;
    Receiver receiver;      // of all rays that may meet it
    Beyond behind;          // its plane
    ScreenSet *set;
    Screen *screen;
    int count;              // of occluders
} ScreenMaker;

// Put LANES occluders of forms `e` on the screen, those that `may` darken a ray.  0 once no more are wanted: one of them
// darkens every ray, or they are too many.
inline int put_on_screen(ScreenMaker *m, const Affine *e, vi may, vi all)
{
    const uint keep = row_bits(may);
    if (row_any(all & may) || m->count + popcount(keep) > m->set->limit) {
        m->screen->rows = row_any(all & may) ? ALL_DARK : NO_SCREEN;
        return 0;
    }
    private float words[OCCLUDER_WORDS * LANES];
    for (int k = 0; k < 4; ++k) store_flat(e[k], words + 3 * k * LANES);
    for (uint left = keep; left; left &= left - 1) {
        global float *to = m->set->pool + (m->set->used + m->count / LANES) * OCCLUDER_WORDS * LANES + m->count % LANES;
        for (int k = 0; k < OCCLUDER_WORDS; ++k) to[k * LANES] = words[k * LANES + lowest(left)];
        ++m->count;
    }
    return 1;
}

// Put on the screen those of LANES triangles of a leaf that can darken a ray.  0 once no more are wanted.
inline int add_to_screen(ScreenMaker *m, global const float *leaf, global const int *leaf_ids)
{
    Affine e[4];
    Occluders o;
    place_occluders(&m->rays, leaf, &o);
    vi may = ~(lie_beyond(&m->behind, &o) | EQ(VLOAD(leaf_ids), (vi)(m->own)) | are_own(m->rays.own, leaf_ids)), all = -1;
    if (!row_any(may)) return 1;
    e[3] = project_plane(&m->receiver, face_occluders(&m->rays, &o, &may));
    sift_occluders(e[3], &m->receiver.over, &may, &all);
    for (int k = 2; k >= 0; --k) {
        if (!row_any(may)) return 1;
        e[k] = project_plane(&m->receiver, edge_of_occluders(&m->rays, &o, k));
        sift_occluders(e[k], &m->receiver.over, &may, &all);
    }
    return put_on_screen(m, e, may, all);
}

// Fill the last row of a new screen with what darkens nothing.
inline void close_screen(const ScreenMaker *m)
{
    ScreenSet *set = m->set;
    int count = m->count;
    m->screen->first = set->used;
    m->screen->rows = (count + LANES - 1) / LANES;
    for (; count % LANES; ++count) {
        global float *to = set->pool + (set->used + count / LANES) * OCCLUDER_WORDS * LANES + count % LANES;
        for (int k = 0; k < OCCLUDER_WORDS; ++k) to[k * LANES] = k % 3 == 0 ? -1.0f : 0.0f;
    }
    set->used += m->screen->rows;
}

inline void take_occluders(const ScreenSet *set, int row, Affine *e)
{
    global const float *at = set->pool + row * OCCLUDER_WORDS * LANES;
    for (int k = 0; k < 4; ++k) {
        const Affine form = {VLOAD(at + 3 * k * LANES), VLOAD(at + (3 * k + 1) * LANES), VLOAD(at + (3 * k + 2) * LANES)};
        e[k] = form;
    }
}


// Darken what lies behind a screen; false when nothing is left.
inline int cast_screen(const ScreenSet *set, const Screen *screen, Darkness *d)
{
    for (int row = screen->first; row < screen->first + screen->rows; ++row) {
        Affine e[4];
        take_occluders(set, row, e);
        if (!cast_occluders(e, (vi)(-1), d)) return 0;
    }
    return 1;
}

#endif
#endif
