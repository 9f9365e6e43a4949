// Shadows: find the rays of a block that see each light.
#pragma once
#include "light_space.cl"
#include "single_rays.cl"

// The ratio of the last to the first depth of a span: hit points are processed by spans of depth.
#define SPAN 1.1f
// Move the rays of the next span of depths from `wanted` to s->active, and bound their hit points.
// Without spans, the box of a near and a far surface would contain everything between them.  A span
// starts at the nearest wanted hit point.  Returns false if no ray is wanted.
inline int next_span(const Shadows *s, const Block *b, global int *wanted, Box *box)
{
    const Bundle *r = &b->bundle;
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

// Find the rays of a block that see a light.
inline void light_block(const Shadows *s, const Block *b, global const LightRecord *light,
                        global int *lit)
{
    global int *wanted = s->active + BLOCK_RAYS;
    clear_lit(lit);
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        VSTORE(facing_row(b->samples, light, at), wanted + at);
    for (Box box; next_span(s, b, wanted, &box);) {
        const ShadowRays rays = make_shadow_rays(light, &box);
        if (SINGLE_RAYS || !cast_light_space(s, b, &rays)) cast_single_rays(s, b, light);
        for (int at = 0; at < BLOCK_RAYS; at += LANES)
            lit[at / BLOCK] |= row_bits(VLOAD(s->active + at)) << at % BLOCK;
    }
}

// A worker's memory: see Shadows.
typedef struct {
    int active[2 * BLOCK_RAYS];
    float projected[6 * BLOCK_RAYS];
    float origins[CURVED ? 3 * BLOCK_RAYS : 1];
} ShadowMemory;

// Find which of a block's rays see each light.
inline void find_lit(Shadows *s, const Block *b, global float *origins)
{
    const int curved = CURVED && offset_origins(s->scene, b, origins);
    s->origins = curved ? origins : b->samples->point;
    for (int k = 0; k < s->scene->numbers->shadow_lights; ++k)
        light_block(s, b, shadow_light(s->scene, k), b->lit + k * BLOCK);
}
