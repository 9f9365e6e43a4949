// Screens: the occluders of one triangle's rays, found once a beam.
//
// Blocks of a beam lie side by side, and most share their triangles with their neighbours.  What may stand between
// the light and all that one element's part of the beam sees of a triangle is gathered when the first block asks, and
// its forms, counted from the middle of that part, are set up for good; often there is nothing.  A screen depends on
// nothing but the beam, the triangle and the light: which block asked first, and what else is traced, changes no bit of it.
#ifndef LFCORE_SCREENS_CL
#define LFCORE_SCREENS_CL
#include "homography.cl"
#include "beam.cl"

#if OUTER == 1
#define SCREENS 64
#define POOL 1024           // occluders of all screens
#define SCREEN_LIMIT 128    // and of one: more are culled block by block
#define OCCLUDER_WORDS 12

// No ray of the beam that meets the triangle sees the light; occluders are culled block by block.
enum { ALL_DARK = -2, NO_SCREEN = -1 };

typedef struct {
    int key;                // triangle and light; -1: none
    int first, rows;        // rows of LANES occluders in the pool, or one of these:
    Rectangle over;         // around the rays of the beam that may meet the triangle
    float lo[3], hi[3];     // of their hit points
} Screen;

typedef struct {
    Screen of[SCREENS];
    global float *pool;     // (POOL / LANES, OCCLUDER_WORDS, LANES) four forms of each occluder
    int used;               // rows of the pool
    int element;            // whose rays these are
    Bundle beam;            // its part of the beam, as if that were one block
    float2 block;           // where the block that is painted lies within
} Screens;

inline void clear_screens(Screens *screens)
{
    for (int k = 0; k < SCREENS; ++k) screens->of[k].key = -1;
    screens->used = 0;
}

// To be called before a block is painted.
inline void enter_element(const Rays *rays, const BeamWork *work, int block, Screens *screens)
{
    screens->block = block_offset(block);
    if (screens->element == block / ELEMENT_BLOCKS) return;
    screens->element = block / ELEMENT_BLOCKS;
    clear_screens(screens);
    screens->beam = element_bundle(rays, work, block);
}

// Where along one axis the rays lie that may meet a triangle with corners at `at` and depths `z`, in columns from the
// middle of those that pass `from` + z `along`, each `step` + z `turn` beside the one before: the middle, and half the extent.
inline float2 span_of(float3 at, float3 z, float from, float along, float step, float turn)
{
    const float3 pitch = fma(z, turn, step), noise = 1.0e-6f * (fabs(at) + fabs(from) + fabs(z * along));
    const int crossed = min(pitch.x, min(pitch.y, pitch.z)) <= 0.0f && max(pitch.x, max(pitch.y, pitch.z)) >= 0.0f;
    // Rays of a pixel cross where it is in focus, and nothing is met behind the lens.
    if (crossed || min(z.x, min(z.y, z.z)) <= 0.0f) return (float2)(0.0f, ELEMENT_HALF);
    const float3 column = (at - from - z * along) / pitch, slack = noise / fabs(pitch) + 0.01f;
    const float3 low = column - slack, high = column + slack;
    const float first = clamp(min(low.x, min(low.y, low.z)), -ELEMENT_HALF, ELEMENT_HALF);
    const float last = clamp(max(high.x, max(high.y, high.z)), -ELEMENT_HALF, ELEMENT_HALF);
    return 0.5f * (float2)(first + last, last - first);
}

// Bounds of what an element's part of the beam sees of triangle `id`; `facet` receives it, prepared for the beam.
inline void screen_bounds(const Surfaces *s, const Bundle *beam, int id, Facet *facet, Screen *screen)
{
    prepare_facet(s, beam, id, 0.0f, facet);
    global const float *at = s->corners + id * 9;
    const float3 x = (float3)(at[0], at[3], at[6]), y = (float3)(at[1], at[4], at[7]), depth = (float3)(at[2], at[5], at[8]);
    const float2 across = span_of(x, depth, beam->ox, beam->dx, beam->sx, beam->tx);
    const float2 down = span_of(y, depth, beam->oy, beam->dy, beam->sy, beam->ty);
    const Rectangle over = {across.x, down.x, across.y, down.y};
    screen->over = over;
    const float3 p = corner(at, 0), q = corner(at, 1), w = corner(at, 2), slack = 1.0e-6f * max(fabs(p), max(fabs(q), fabs(w)));
    const float3 low = min(p, min(q, w)) - slack, high = max(p, max(q, w)) + slack;
    float2 z = (float2)(max(low.z, 0.0f), high.z);
    if (one_sided_over(facet, over)) {
        const float2 depths = facet_depths(facet, over);
        z = (float2)(max(z.x, depths.x), max(max(z.x, depths.x), min(z.y, depths.y)));
    }
    bundle_bounds(beam, over, z.x, z.y, screen->lo, screen->hi);
    const float l[2] = {low.x, low.y}, h[2] = {high.x, high.y};
    for (int k = 0; k < 2; ++k) {
        // Rounding apart, both hold what is seen.
        screen->lo[k] = min(max(screen->lo[k], l[k]), h[k]);
        screen->hi[k] = max(min(screen->hi[k], h[k]), screen->lo[k]);
    }
}

// Whether hit points on a facet times their weight may be moved from block to block of a beam: rounding is that of the
// largest weight, and what is excluded near the surface a multiple of each.
inline int evenly_weighted(const Facet *f, Rectangle at)
{
    const float middle = f->under.c + at.x * f->under.i + at.y * f->under.j;
    const float spread = at.wide * fabs(f->under.i) + at.high * fabs(f->under.j);
    return middle - spread > 0.125f * max(middle + spread, f->under.c);
}

// What is not negative at a point relative to the apex: n . P + c, where that lies behind a triangle's plane, or before it by
// less than what is excluded near surfaces.
typedef struct { float3 n; float c; } Behind;

inline Behind behind_plane(global const float *corners, const ShadowRays *r)
{
    const float3 p = corner(corners, 0), n = cross(corner(corners, 1) - p, corner(corners, 2) - p), at = p - r->apex;
    const float offset = dot(n, at), side = r->is_point ? offset : -dot(n, r->towards), sign = side < 0.0f ? -1.0f : 1.0f;
    const Behind b = {sign * n, SHADOW_MARGIN * dot(fabs(n), fabs(at) + r->size) - sign * offset};
    return b;
}

inline vi lie_behind(const Behind *b, const Occluders *o)
{
    vf least = FAR;
    for (int k = 0; k < 3; ++k)
        least = min(least, fma(o->v[k].x, (vf)(b->n.x), fma(o->v[k].y, (vf)(b->n.y), fma(o->v[k].z, (vf)(b->n.z), (vf)(b->c)))));
    return GE(least, (vf)(0.0f));
}

// What a new screen, which the pool ends with, is made with.
typedef struct {
    int own;                // the triangle that it is before
    ShadowRays rays;
    Receiver receiver;      // of all rays that may meet it
    Behind behind;          // its plane
    Screens *screens;
    Screen *screen;
    int count;              // of occluders
} ScreenMaker;

// Put on the screen those of LANES triangles of a leaf that can darken a ray.  0 once no more are wanted: one of them darkens
// every ray, or they are too many.
inline int add_to_screen(ScreenMaker *m, const Shaft *shaft, global const float *leaf, global const int *leaf_ids)
{
    vi may = ~(shaft_misses(shaft, leaf) | EQ(VLOAD(leaf_ids), (vi)(m->own))), all = -1;
    if (!row_any(may)) return 1;
    Affine e[4];
    Occluders o;
    place_occluders(&m->rays, leaf, &o);
    may &= ~lie_behind(&m->behind, &o);
    if (!row_any(may)) return 1;
    e[3] = project_plane(&m->receiver, face_occluders(&m->rays, &o, &may));
    sift_occluders(e[3], &m->receiver.over, &may, &all);
    for (int k = 2; k >= 0; --k) {
        if (!row_any(may)) return 1;
        e[k] = project_plane(&m->receiver, edge_of_occluders(&m->rays, &o, k));
        sift_occluders(e[k], &m->receiver.over, &may, &all);
    }
    all &= may;
    const uint keep = row_bits(may);
    if (row_any(all) || m->count + popcount(keep) > SCREEN_LIMIT) {
        m->screen->rows = row_any(all) ? ALL_DARK : NO_SCREEN;
        return 0;
    }
    private float words[OCCLUDER_WORDS * LANES];
    for (int k = 0; k < 4; ++k) store_flat(e[k], words + 3 * k * LANES);
    for (uint left = keep; left; left &= left - 1) {
        global float *to = m->screens->pool + (m->screens->used + m->count / LANES) * OCCLUDER_WORDS * LANES + m->count % LANES;
        for (int k = 0; k < OCCLUDER_WORDS; ++k) to[k * LANES] = words[k * LANES + lowest(left)];
        ++m->count;
    }
    return 1;
}

// Fill the last row of a new screen with what darkens nothing.
inline void close_screen(const ScreenMaker *m)
{
    Screens *screens = m->screens;
    Screen *screen = m->screen;
    int count = m->count;
    screen->first = screens->used;
    screen->rows = (count + LANES - 1) / LANES;
    for (; count % LANES; ++count) {
        global float *to = screens->pool + (screens->used + count / LANES) * OCCLUDER_WORDS * LANES + count % LANES;
        for (int k = 0; k < OCCLUDER_WORDS; ++k) to[k * LANES] = k % 3 == 0 ? -1.0f : 0.0f;
    }
    screens->used += screen->rows;
}

// Darken what lies behind a screen; false when nothing is left.
inline int cast_screen(const Screens *screens, const Screen *screen, Darkness *d)
{
    for (int row = screen->first; row < screen->first + screen->rows; ++row) {
        global const float *at = screens->pool + row * OCCLUDER_WORDS * LANES;
        Affine e[4];
        for (int k = 0; k < 4; ++k) {
            const Affine form = {VLOAD(at + 3 * k * LANES), VLOAD(at + (3 * k + 1) * LANES), VLOAD(at + (3 * k + 2) * LANES)};
            e[k] = form;
        }
        if (!cast_occluders(e, (vi)(-1), d)) return 0;
    }
    return 1;
}

#endif
#endif
