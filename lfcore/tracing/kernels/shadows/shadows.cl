// Shadows: find the rays that see each light.
#pragma once
#include "light_space.cl"
#include "single_rays.cl"
#include "tints.cl"

// The ratio of the last to the first depth of a span: hit points are processed by spans of depth.
#define SPAN 1.1f
// Move the rays of the next span of depths from `wanted` to s->active, and bound their hit points.
// Without spans, the box of a near and a far surface would contain everything between them.  A span
// starts at the nearest wanted hit point.  Returns false if no ray is wanted.
inline int next_span(const Shadows *s, const Bundle *r, global int *wanted, Box *box)
{
    global const float *z = s->origins + 2 * BLOCK_RAYS;
    vf nearest = FAR;
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        nearest = pick(nearest, VLOAD(z + at), VLOAD(wanted + at) & LT(VLOAD(z + at), nearest));
    const float from = row_min(nearest);
    if (from >= FAR) return 0;
    const float step = max(fabs(fma(from, r->tx, r->sx)), fabs(fma(from, r->ty, r->sy)));
    const float footprint = INNER * step + (OUTER - 1) * fabs(fma(from, r->b, r->a));
    // Offset origins may be behind the lens.  Every span has the nearest, so there are at most
    // BLOCK_RAYS spans.
    const float most = fma(from, from < 0.0f ? 1.0f / SPAN : SPAN, 2.0f * footprint);
    const float until = most > from ? most : from;
    Ranges ranges;
    clear_ranges(&ranges);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi want = VLOAD(wanted + at), within = want & LE(VLOAD(z + at), (vf)(until));
        VSTORE(within, s->active + at);
        VSTORE(want & ~within, wanted + at);
        add_to_ranges(&ranges, load3(s->origins, at), within);
    }
    *box = box_of(&ranges);
    return 1;
}

inline void add_lit(const Shadows *s, global int *lit)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        lit[at / BLOCK] |= row_bits(VLOAD(s->active + at)) << at % BLOCK;
}

// Find the rays that see a light.
inline void light_rays(const Shadows *s, global const Hits *hits, const Bundle *bundle,
                       global const LightRecord *light, global int *lit)
{
    global int *wanted = SINGLE_RAYS ? s->active : s->active + BLOCK_RAYS;
    clear_lit(lit);
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        VSTORE(facing_row(hits, light, at), wanted + at);
    if (SINGLE_RAYS) {
        cast_single_rays(s, hits, light);
        add_lit(s, lit);
        return;
    }
    for (Box box; next_span(s, bundle, wanted, &box);) {
        const ShadowRays rays = make_shadow_rays(light, &box);
        if (!cast_light_space(s, hits, &rays)) cast_single_rays(s, hits, light);
        add_lit(s, lit);
    }
}

// A worker's memory: see Shadows.
typedef struct {
    int active[2 * BLOCK_RAYS];
    float projected[6 * BLOCK_RAYS];
    float origins[SMOOTH ? 3 * BLOCK_RAYS : 1];
} ShadowMemory;

// Find which rays see each light: single rays need no `bundle`.
inline void find_lit(Shadows *s, global const Hits *hits, const Bundle *bundle,
                     global float *origins, global int *lit)
{
    const int curved =
        SMOOTH && s->scene->numbers->curved && offset_origins(s->scene, hits, origins);
    s->origins = curved ? origins : hits->point;
    const int lights = s->scene->numbers->shadow_lights;
    for (int k = 0; k < lights; ++k) {
        global const LightRecord *light = shadow_light(s->scene, k);
        light_rays(s, hits, bundle, light, lit + k * BLOCK);
        if (CLEAR) find_tints(s, hits, light, lit + k * BLOCK, tints_of(s->scene, lit, k));
    }
}
