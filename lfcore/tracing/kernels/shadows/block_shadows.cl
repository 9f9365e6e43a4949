// Shadows of a block of many triangles or several elements, all rays together.
#pragma once
#include "light_space.cl"
#include "single_rays.cl"

// Hit points are taken by spans of depth, each to this multiple of where it begins.
#define SPAN 1.1f

// Mark the rays that meet a side which faces the light, in `wanted`: masks.
inline void find_facing(const Block *b, global const LightRecord *light, global int *wanted)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        VSTORE(facing_row(b->samples, light, at), wanted + at);
}

// Move the wanted rays whose hit points lie within a span of depths from `wanted` to s->active, and
// bound them.  A block that sees a near thing before a far one would otherwise span all that lies
// between; the span starts at the nearest of what is left.  Returns false when nothing is left.
inline int next_span(const Shadows *s, const Block *b, global int *wanted, Box *box)
{
    const Bundle *r = &b->rays;
    global const float *z = s->origins + 2 * BLOCK_RAYS;
    vf nearest = FAR;
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        nearest = pick(nearest, min(nearest, VLOAD(z + at)), VLOAD(wanted + at));
    const float from = row_min(nearest);
    if (from >= FAR) return 0;
    const float step = max(fabs(fma(from, r->tx, r->sx)), fabs(fma(from, r->ty, r->sy)));
    const float footprint = INNER * step + (OUTER - 1) * fabs(fma(from, r->b, r->a));
    const float until = fma(from, SPAN, 2.0f * footprint);
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

inline void add_active(const Shadows *s, global int *lit)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        lit[at / BLOCK] |= row_bits(VLOAD(s->active + at)) << at % BLOCK;
}

// A block that sees more triangles than this follows its shadow rays: one for two rays, as
// measured.
#define MANY_REGIONS (BLOCK_RAYS / 2)

// Find the rays of a block that see a light.
inline void light_block(const Shadows *s, const Block *b, global const LightRecord *light,
                        global int *lit)
{
    clear_lit(lit);
    if (SINGLE_RAYS || b->regions.count > MANY_REGIONS) {
        find_facing(b, light, s->active);
        cast_single_rays(s, b, light);
        add_active(s, lit);
        return;
    }
    global int *wanted = s->active + BLOCK_RAYS;
    Box box;
    for (find_facing(b, light, wanted); next_span(s, b, wanted, &box);) {
        const ShadowRays rays = make_shadow_rays(light, &box);
        if (!cast_light_space(s, b, &rays)) cast_single_rays(s, b, light);
        add_active(s, lit);
    }
}
