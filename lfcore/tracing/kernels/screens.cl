// Screens: the occluders of one triangle's rays, found once a beam.
//
// Blocks of a beam lie side by side, and most share their triangles with their neighbours.  What may stand between
// the light and all that one element's part of the beam sees of a triangle is gathered when the first block asks, and
// set up for good; often there is nothing.  A screen depends on nothing but the beam, the triangle and the light: which
// block asked first, and what else is traced, changes no bit of it.
#ifndef LFCORE_SCREENS_CL
#define LFCORE_SCREENS_CL
#include "homography.cl"
#include "beam.cl"

#if OUTER == 1
#define SCREENS 64
#define POOL 1024           // occluders of all screens
#define SCREEN_LIMIT 128    // and of one: more are culled block by block
#define PLANE_WORDS 16

typedef struct {
    int key;                // triangle and light; -1: none
    int first, rows;        // rows of LANES occluders in the pool; rows -1: more than SCREEN_LIMIT
    float lo[3], hi[3];     // of all that the beam may see of the triangle
} Screen;

typedef struct {
    Screen of[SCREENS];
    global float *pool;     // (POOL / LANES, PLANE_WORDS, LANES) four planes of each occluder
    int used;               // rows of the pool
    int element;            // whose rays these are
    Bundle beam;            // its part of the beam, as if that were one block
    Rectangle reach;
} Screens;

inline void clear_screens(Screens *screens)
{
    for (int k = 0; k < SCREENS; ++k) screens->of[k].key = -1;
    screens->used = 0;
}

// To be called before a block is painted.
inline void enter_element(const Rays *rays, const BeamWork *work, int block, Screens *screens)
{
    if (screens->element == block / ELEMENT_BLOCKS) return;
    screens->element = block / ELEMENT_BLOCKS;
    clear_screens(screens);
    screens->beam = element_bundle(rays, work, block);
    screens->reach.x = screens->reach.y = 0.0f;
    screens->reach.wide = screens->reach.high = ELEMENT_HALF;
}

// Bounds of what an element's part of the beam sees of triangle `id`; `facet` receives it, prepared for the beam.
// Returns whether all of its rays see it from one side.
inline int screen_bounds(const Surfaces *s, const Screens *screens, int id, Facet *facet, float *lo, float *hi)
{
    prepare_facet(s, &screens->beam, id, 0.0f, facet);
    global const float *at = s->corners + id * 9;
    const float3 p = corner(at, 0), q = corner(at, 1), w = corner(at, 2), slack = 1.0e-6f * max(fabs(p), max(fabs(q), fabs(w)));
    const float3 low = min(p, min(q, w)) - slack, high = max(p, max(q, w)) + slack;
    float2 z = (float2)(max(low.z, 0.0f), high.z);
    const int sided = one_sided_over(facet, screens->reach);
    if (sided) {
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
    return sided;
}

// Put the lanes in `keep` on the screen that the pool ends with; 0 once they are too many.
inline int add_to_screen(Screens *screens, int *count, const Plane *planes, uint keep)
{
    private float words[PLANE_WORDS * LANES];
    for (int k = 0; k < 4; ++k) {
        VSTORE(planes[k].n.x, words + 4 * k * LANES); VSTORE(planes[k].n.y, words + (4 * k + 1) * LANES);
        VSTORE(planes[k].n.z, words + (4 * k + 2) * LANES); VSTORE(planes[k].c, words + (4 * k + 3) * LANES);
    }
    for (; keep; keep &= keep - 1) {
        if (*count == SCREEN_LIMIT) return 0;
        const uint lane = lowest(keep);
        global float *to = screens->pool + (screens->used + *count / LANES) * PLANE_WORDS * LANES + *count % LANES;
        for (int k = 0; k < PLANE_WORDS; ++k) to[k * LANES] = words[k * LANES + lane];
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
        global float *to = screens->pool + (screens->used + count / LANES) * PLANE_WORDS * LANES + count % LANES;
        for (int k = 0; k < PLANE_WORDS; ++k) to[k * LANES] = k % 4 == 3 ? -1.0f : 0.0f;
    }
    screens->used += screen->rows;
}

// Darken a receiver's rays behind its screen; false when none is left.
inline int cast_screen(const Screens *screens, const Screen *screen, const Receiver *receiver, Darkness *d)
{
    for (int row = screen->first; row < screen->first + screen->rows; ++row) {
        global const float *at = screens->pool + row * PLANE_WORDS * LANES;
        Plane planes[4];
        for (int k = 0; k < 4; ++k) {
            planes[k].n.x = VLOAD(at + 4 * k * LANES); planes[k].n.y = VLOAD(at + (4 * k + 1) * LANES);
            planes[k].n.z = VLOAD(at + (4 * k + 2) * LANES); planes[k].c = VLOAD(at + (4 * k + 3) * LANES);
        }
        if (!cast_planes(receiver, planes, (vi)(-1), d)) return 0;
    }
    return 1;
}

#else
typedef void Screens;
#endif
#endif
