// Shadows: which rays of a block cannot see a light.
//
// All shadow rays of a block share the light as apex (or a direction), so a triangle is set up once
// per block and light: inside its three edge planes and beyond its own plane is dark.  Four affine
// forms of the hit point decide that, relative to the light; hit points never leave that frame, and
// what is excluded near the surface is relative to the numbers that enter, not an absolute length.
#ifndef LFCORE_SHADOWS_CL
#define LFCORE_SHADOWS_CL
#include "shading.cl"

#if SHADOW_LIGHTS
#include "homography.cl"
#include "light_view.cl"
#include "scattered.cl"

#define SHADOW_LIST 512
#define SPAN 1.1f

// A worker's memory for shadows.
typedef struct {
    LeafList list;         // leaves between the light and the whole beam, where `complete`; else scratch
    LeafList nearby;       // scratch
    int complete;
    global int *open, *seeing;  // (BLOCK_RAYS,) masks: rays of one span, rays that see the light
    global float *seen;         // (3, BLOCK_RAYS) see light_view.cl
} ShadowMemory;

// What is darkened: rays `open` of a block, all on triangle `own` of one element, or as the light sees them.
typedef struct {
    int own;                    // -1: not all on one triangle
    const Receiver *receiver;
    const Receivers *receivers; // its triangles, as if each filled the block
    LightView view;
    Strips strips;
    global const float *seen;
    global const int *ids;
    global int *open;
} Target;

// Hit points that want a light and lie within a span of depths: moves them from `wants` to `open`, and
// bounds them.  A block that sees a near thing before a far one would otherwise span all that lies
// between; the span starts at the nearest of what is left.  Returns false when nothing is left.
inline int next_span(const Bundle *r, global const float *point, global int *wants, global int *open, float *lo, float *hi)
{
    global const float *z = point + 2 * BLOCK_RAYS;
    vf nearest = FAR;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) nearest = pick(nearest, min(nearest, VLOAD(z + at)), VLOAD(wants + at));
    const float from = row_min(nearest);
    if (from >= FAR) return 0;
    const float footprint = INNER * max(fabs(fma(from, r->tx, r->sx)), fabs(fma(from, r->ty, r->sy))) +
                            (OUTER - 1) * fabs(fma(from, r->b, r->a));
    const float until = fma(from, SPAN, 2.0f * footprint);
    vf low[3], high[3];
    for (int k = 0; k < 3; ++k) { low[k] = FAR; high[k] = -FAR; }
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi want = VLOAD(wants + at), within = want & LE(VLOAD(z + at), (vf)(until));
        VSTORE(within, open + at);
        VSTORE(want & ~within, wants + at);
        for (int k = 0; k < 3; ++k) {
            const vf x = VLOAD(point + k * BLOCK_RAYS + at);
            low[k] = pick(low[k], min(low[k], x), within);
            high[k] = pick(high[k], max(high[k], x), within);
        }
    }
    for (int k = 0; k < 3; ++k) {
        lo[k] = row_min(low[k]);
        hi[k] = row_max(high[k]);
    }
    return 1;
}

// Darken the target behind LANES triangles; false once no ray of it can see the light.
inline int cast_leaf(const ShadowRays *r, const Target *target, const Plane *planes, vi may, global const int *leaf_ids)
{
    private float forms[SHADOW_FORMS * LANES];  // those on a facet are twelve
#if OUTER == 1
    private int rows[2 * LANES];
    const Receiver *receiver = target->receiver;
    if (!receiver && target->receivers->count) may = darkens_some(target->receivers, r, planes, may);
    if (!row_any(may)) return 1;
    uint keep = receiver ? project_occluders(receiver, planes, may, forms, rows) : store_occluders(r, &target->view, planes, may, forms);
#else
    uint keep = store_occluders(r, &target->view, planes, may, forms);
#endif
    for (; keep; keep &= keep - 1) {
        const uint k = lowest(keep);
        const int id = leaf_ids[k];
        if (id == target->own) continue;
#if OUTER == 1
        if (receiver) {
            if (!cast_on_facet(forms, k, rows[k], rows[LANES + k], target->open)) return 0;
            continue;
        }
#endif
        if (!cast_shadow(&target->view, &target->strips, forms, k, id, target->ids, target->seen, target->open)) return 0;
    }
    return 1;
}

// Darken the target behind the leaves on a list; false once no ray of it can see the light.
inline int cast_list(const Bvh *bvh, const Shaft *shaft, const ShadowRays *r, const LeafList *list, const Target *target)
{
    Plane planes[4];
    for (int base = 0; base < list->count; base += LANES) {
        uint near = row_bits(shaft_meets(shaft, list->boxes + base, list->pitch));
        if (base + LANES > list->count) near &= (1u << (list->count - base)) - 1u;
        for (; near; near &= near - 1) {
            const int leaf = list->leaf[base + lowest(near)];
            for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
                const vi may = setup_occluders(r, shaft, bvh->leaves + leaf * 9 * NODE_WIDTH + lane, planes);
                if (!row_any(may)) continue;
                if (!cast_leaf(r, target, planes, may, bvh->leaf_ids + leaf * NODE_WIDTH + lane)) return 0;
            }
        }
    }
    return 1;
}

// Darken the target's rays, whose hit points lo and hi bound.
inline void darken(const Bvh *bvh, global const float *light, const ShadowRays *rays, ShadowMemory *memory, const float *lo,
                   const float *hi, const Target *target)
{
    const Shaft shaft = make_shaft(light, lo, hi);
    if (memory->complete) {
        cast_list(bvh, &shaft, rays, &memory->list, target);
        return;
    }
    Walk walk;
    start_walk(&walk);
    while (walk.size) {
        memory->list.count = 0;
        gather_shaft(bvh, &shaft, &walk, &memory->list);
        if (!cast_list(bvh, &shaft, rays, &memory->list, target)) return;
    }
}

#if OUTER == 1
// Take from `wants` the rays of a block on triangle `own`, bounded by lo and hi, that cannot see the light.
inline void shadow_facet(const Bvh *bvh, global const float *light, ShadowMemory *memory, const Bundle *bundle, const Facet *facet,
                         int own, const float *lo, const float *hi, global int *wants)
{
    const ShadowRays rays = shadow_rays(light, lo, hi);
    const Receiver receiver = make_receiver(bundle, facet, rays.apex);
    Target target;
    target.own = own;
    target.receiver = &receiver;
    target.open = wants;
    darken(bvh, light, &rays, memory, lo, hi, &target);
}
#endif

// Take from `wants` the rays of a block on `facets` that cannot see the light.
inline void shadow_block(const Bvh *bvh, global const float *light, ShadowMemory *memory, const Bundle *bundle,
                         const Facets *facets, global const int *ids, global const float *point, global int *wants)
{
    float lo[3], hi[3];
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE((vi)(0), memory->seeing + at);
    Target target;
    target.own = -1;
    target.receiver = 0;
    target.seen = memory->seen;
    target.ids = ids;
    target.open = memory->open;
    while (next_span(bundle, point, wants, memory->open, lo, hi)) {
        const ShadowRays rays = shadow_rays(light, lo, hi);
#if OUTER == 1
        Receivers receivers;
        make_receivers(bundle, facets, rays.apex, &receivers);
        target.receivers = &receivers;
#endif
        target.view = make_light_view(&rays);
        if (see_from_light(&rays, point, memory->open, &target.view, &target.strips, memory->seen))
            darken(bvh, light, &rays, memory, lo, hi, &target);
        else
            shadow_rays_singly(bvh, light, &memory->list, memory->complete, &memory->nearby, ids, point, memory->open);
        for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(VLOAD(memory->seeing + at) | VLOAD(memory->open + at), memory->seeing + at);
    }
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(VLOAD(memory->seeing + at), wants + at);
}
#endif

#endif
