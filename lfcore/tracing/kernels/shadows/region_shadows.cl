// Shadows of a block of one element on few triangles, region by region.
#ifndef LFCORE_REGION_SHADOWS_CL
#define LFCORE_REGION_SHADOWS_CL
#include "occluder_cache.cl"

// Darken a region's rays behind LANES occluders; false once none is lit.
inline int cast_planes(const Receiver *f, const Plane *planes, vi may, ShadowMask *m)
{
    Forms e[4];
    for (int k = 0; k < 4; ++k) e[k] = project_plane(f, planes[k]);
    return cast_forms(e, may, m);
}

// Darken a region for which the cache keeps no occluders.  What occluders are relative to is as of
// the cache, so that both give the same shadows.
inline void cast_uncached(Shadows *s, const Block *b, int number, int k, ShadowMask *m)
{
    global const float *light = shadow_light(s->scene, number);
    global const PlaneEquations *planes = b->planes + k;
    const int triangle = b->regions.of[k].triangle;
    const float2 depths = quotient_range(planes->numerator, planes->denominator, m->over);
    const Box box = bundle_box(&b->rays, m->over, depths);
    darken_all(m);
    if (turned_away(planes, &b->rays, m->over, light, &box)) return;
    *m = no_shadow(b->regions.of + k, 0.0f);
    const Bundle *all = &s->cache->rays;
    set_up_planes(s->scene, all, triangle, 0.0f, s->element_planes);
    const SeenTriangle seen = see_triangle(s->scene, all, triangle, s->element_planes);
    ShadowRays rays = make_shadow_rays(light, &seen.box);
    const Receiver receiver = make_receiver(&b->rays, planes, rays.apex);
    aim_at(&rays, &box);
    NearbyLeaves nearby;
    for (start_nearby(s, number, &box, &nearby); next_nearby(s, &nearby);)
        for (int leaf = 0; leaf < s->nearby.count; ++leaf)
            for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
                Plane forms[4];
                global const float *corners = leaf_corners(s->tree, s->nearby.leaf[leaf], lane);
                global const int *ids = leaf_numbers(s->tree, s->nearby.leaf[leaf], lane);
                vi may = set_up_occluders(&rays, &nearby.shaft, corners, forms);
                may &= ~(EQ(VLOAD(ids), (vi)(triangle)) | are_own(rays.own, ids));
                if (row_any(may) && !cast_planes(&receiver, forms, may, m)) return;
            }
}

// Whether regions are few and each is seen from one side.  Holes are looked into ray by ray.
#define FEW_REGIONS 6
inline int few_regions(const Block *b)
{
    if (OUTER > 1 || SINGLE_RAYS || CUT_OUTS || b->regions.count > FEW_REGIONS) return 0;
    for (int k = 0; k < b->regions.count; ++k)
        if (!is_one_sided(b->planes[k].denominator, region_rectangle(b->regions.of + k))) return 0;
    return 1;
}

// Add the rays of each region that see light `number` to `lit`.
inline void light_regions(Shadows *s, const Block *b, int number, global int *lit)
{
    for (int k = 0; k < b->regions.count; ++k) {
        global const Region *r = b->regions.of + k;
        const CacheEntry *entry = find_entry(s, r->triangle, number);
        if (entry->rows == ALL_DARK) continue;
        ShadowMask m;
        if (entry->rows == NOT_KEPT) {
            m = no_shadow(r, 0.0f);
            cast_uncached(s, b, number, k, &m);
        } else {
            m = no_shadow(r, block_offset(b->number));
            cast_entry(s->cache, entry, &m);
        }
        add_lit(&m, lit);
    }
}

#endif
