// Shadows of a block of one element on few triangles, region by region.
#pragma once
#include "occluder_cache.cl"

// Whether regions are few.  Holes are looked into ray by ray.
#define FEW_REGIONS 6
inline int few_regions(const Block *b)
{
    return OUTER == 1 && !SINGLE_RAYS && !CUT_OUTS && b->regions.count <= FEW_REGIONS;
}

inline int faces_light(const Block *b, global const Region *r, global const LightRecord *light)
{
    vi facing = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        facing |= region_row(r, at) & facing_row(b->samples, light, at);
    return row_any(facing);
}

// Find the rays of each region that see light `number`; false if the cache does not keep what may
// stand before one of them.
inline int light_regions(Shadows *s, const Block *b, int number, global int *lit)
{
    clear_lit(lit);
    for (int k = 0; k < b->regions.count; ++k) {
        global const Region *r = b->regions.of + k;
        CacheEntry *entry = entry_of(s, r->triangle, number);
        if (entry->triangle != r->triangle || entry->light != number) {
            if (!faces_light(b, r, shadow_light(s->scene, number))) continue;
            make_entry(s, r->triangle, number, entry);
        }
        if (entry->count == NOT_KEPT) return 0;
        if (entry->count == ALL_DARK) continue;
        ShadowMask m = no_shadow(r, b->rays.half_extent, block_offset(s->packet, b->number));
        if (cast_entry(s->cache, entry, &m)) add_lit(&m, lit);
    }
    return 1;
}
