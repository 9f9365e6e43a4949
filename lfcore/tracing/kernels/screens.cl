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
    float lo[3], hi[3];     // of all that the beam may see of the triangle
} Screen;

typedef struct {
    Screen of[SCREENS];
    global float *pool;     // (POOL / LANES, OCCLUDER_WORDS, LANES) four forms of each occluder
    int used;               // rows of the pool
    int element;            // whose rays these are
    Bundle beam;            // its part of the beam, as if that were one block
    Rectangle reach;
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
    screens->reach.x = screens->reach.y = 0.0f;
    screens->reach.wide = screens->reach.high = ELEMENT_HALF;
}

// Bounds of what an element's part of the beam sees of triangle `id`; `facet` receives it, prepared for the beam.
inline void screen_bounds(const Surfaces *s, const Screens *screens, int id, Facet *facet, float *lo, float *hi)
{
    prepare_facet(s, &screens->beam, id, 0.0f, facet);
    global const float *at = s->corners + id * 9;
    const float3 p = corner(at, 0), q = corner(at, 1), w = corner(at, 2), slack = 1.0e-6f * max(fabs(p), max(fabs(q), fabs(w)));
    const float3 low = min(p, min(q, w)) - slack, high = max(p, max(q, w)) + slack;
    float2 z = (float2)(max(low.z, 0.0f), high.z);
    if (one_sided_over(facet, screens->reach)) {
        const float2 depths = facet_depths(facet, screens->reach);
        z = (float2)(max(z.x, depths.x), max(max(z.x, depths.x), min(z.y, depths.y)));
    }
    bundle_bounds(&screens->beam, screens->reach, z.x, z.y, lo, hi);
    const float l[2] = {low.x, low.y}, h[2] = {high.x, high.y};
    for (int k = 0; k < 2; ++k) {
        // Rounding apart, both hold what is seen.
        lo[k] = min(max(lo[k], l[k]), h[k]);
        hi[k] = max(min(hi[k], h[k]), lo[k]);
    }
}

// Whether hit points on a facet times their weight may be moved from block to block of a beam: rounding is that of the
// largest weight, and what is excluded near the surface a multiple of each.
inline int evenly_weighted(const Facet *f, Rectangle at)
{
    return at.wide * fabs(f->under.i) + at.high * fabs(f->under.j) < 0.75f * f->under.c;
}

// Put on a new screen, which the pool ends with, those of LANES occluders in `may` that can darken a ray of its receiver.
// 0 once no more are wanted: one of them darkens every ray, or they are too many.
inline int add_to_screen(const Receiver *receiver, const Plane *planes, vi may, Screens *screens, Screen *screen, int *count)
{
    Affine e[4];
    vi all = may;
    for (int k = 3; k >= 0; --k) {
        e[k] = project_plane(receiver, planes[k]);
        sift_occluders(e[k], &receiver->over, &may, &all);
        if (!row_any(may)) return 1;
    }
    const uint keep = row_bits(may);
    if (row_any(all) || *count + popcount(keep) > SCREEN_LIMIT) {
        screen->rows = row_any(all) ? ALL_DARK : NO_SCREEN;
        return 0;
    }
    private float words[OCCLUDER_WORDS * LANES];
    for (int k = 0; k < 4; ++k) store_flat(e[k], words + 3 * k * LANES);
    for (uint left = keep; left; left &= left - 1) {
        global float *to = screens->pool + (screens->used + *count / LANES) * OCCLUDER_WORDS * LANES + *count % LANES;
        for (int k = 0; k < OCCLUDER_WORDS; ++k) to[k * LANES] = words[k * LANES + lowest(left)];
        ++*count;
    }
    return 1;
}

// Fill the last row of a new screen with what darkens nothing.
inline void close_screen(Screens *screens, Screen *screen, int count)
{
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

#else
typedef void Screens;
#endif
#endif
