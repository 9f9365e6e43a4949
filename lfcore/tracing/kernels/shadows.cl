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
#include "between.cl"
#include "screens.cl"
#include "light_view.cl"
#include "scattered.cl"

#define SPAN 1.1f

// A worker's memory for shadows.
typedef struct {
    Between between;
    LeafList nearby;       // scratch
    global int *open, *seeing;  // (BLOCK_RAYS,) masks: rays of one span, rays that see the light
    global float *seen;         // (3, BLOCK_RAYS) see light_view.cl
#if OUTER == 1
    Screens screens;
#endif
} ShadowMemory;

// What is done with occluders: rays of a block are darkened, those `open` as the light sees them or those on one
// triangle; or they are put on that triangle's screen.
typedef struct {
    global const int *ids;      // of the block
    global int *open;
    LightView view;
    Strips strips;
    global const float *seen;
#if OUTER == 1
    int own;                    // the triangle; -1: rays on any are darkened
    const Receiver *receiver;   // of the rays on it
    Darkness *darkness;         // of them
    ScreenMaker *maker;         // 0: rays are darkened
#endif
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
inline int cast_leaf(const ShadowRays *r, Target *target, const Plane *planes, vi may, global const int *leaf_ids)
{
#if OUTER == 1
    if (target->own >= 0) return cast_planes(target->receiver, planes, may & ~EQ(VLOAD(leaf_ids), (vi)(target->own)), target->darkness);
#endif
    private float forms[SHADOW_FORMS * LANES];
    for (uint keep = store_occluders(r, &target->view, planes, may, forms); keep; keep &= keep - 1) {
        const uint k = lowest(keep);
        if (!cast_shadow(&target->view, &target->strips, forms, k, leaf_ids[k], target->ids, target->seen, target->open)) return 0;
    }
    return 1;
}

// Darken the target behind `count` leaves; false once no ray of it can see the light.
inline int cast_leaves(const Bvh *bvh, const Shaft *shaft, const ShadowRays *r, global const int *leaves, int count, Target *target)
{
    Plane planes[4];
    for (int k = 0; k < count; ++k)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
            global const float *corners = bvh->leaves + leaves[k] * 9 * NODE_WIDTH + lane;
            global const int *ids = bvh->leaf_ids + leaves[k] * NODE_WIDTH + lane;
#if OUTER == 1
            if (target->maker) {
                if (!add_to_screen(target->maker, corners, ids)) return 0;
                continue;
            }
#endif
            const vi may = setup_occluders(r, shaft, corners, planes) & ~are_own(r->own, ids);
            if (row_any(may) && !cast_leaf(r, target, planes, may, ids)) return 0;
        }
    return 1;
}

// Darken the target's rays, whose hit points lo and hi bound, behind leaves of `list` or, without one, of the whole scene;
// false once none of them can see the light.
inline int darken(const Bvh *bvh, global const float *light, const ShadowRays *rays, const LeafList *list, LeafList *scratch,
                  const float *lo, const float *hi, Target *target)
{
    const Shaft shaft = make_shaft(light, lo, hi);
    Walk walk;
    start_walk(&walk);
    if (list) walk.size = 0;
    do {
        const int count = list ? pick_leaves(&shaft, list, scratch->leaf)
                               : gather_leaves(bvh, &shaft, &walk, scratch->pitch, scratch->leaf);
        if (!cast_leaves(bvh, &shaft, rays, scratch->leaf, count, target)) return 0;
    } while (walk.size);
    return 1;
}

#if OUTER == 1
// Make the screen before triangle `id`, for the rays of the beam.
inline void make_screen(const Bvh *bvh, const Surfaces *s, global const float *light, ShadowMemory *memory, int id, ScreenSet *set,
                        Screen *screen)
{
    const Screens *screens = &memory->screens;
    const Bundle *bundle = &screens->bundle;
    Facet facet;
    prepare_facet(s, bundle, id, 0.0f, &facet);
    const Seen seen = see_triangle(s, bundle, screens->all, id, &facet);
    ScreenMaker maker;
    maker.own = id;
    maker.rays = shadow_rays(light, seen.lo, seen.hi);
    screen->rows = NO_SCREEN;
    if (!evenly_weighted(&facet, seen.over)) return;
    screen->rows = ALL_DARK;
    if (turned_away(&facet, bundle, seen.over, light, seen.lo, seen.hi)) return;
    maker.receiver = make_receiver(bundle, &facet, seen.over, maker.rays.apex);
    maker.behind = behind_plane(s->corners + id * 9, &maker.rays);
    maker.set = set;
    maker.screen = screen;
    maker.count = 0;
    Target target;
    target.own = id;
    target.maker = &maker;
    const LeafList *list = list_between(bvh, light, &memory->between);
    if (darken(bvh, light, &maker.rays, list, &memory->nearby, seen.lo, seen.hi, &target)) close_screen(&maker);
}

// The screen before what the beam sees of triangle `id`, in light `number`.
inline const Screen *find_screen(const Bvh *bvh, const Surfaces *s, int number, ShadowMemory *memory, int id)
{
    global const float *light = s->lights + (OPEN_LIGHTS + number) * LIGHT;
    const int key = id * SHADOW_LIGHTS + number;
    Screens *screens = &memory->screens;
    Screen *screen = free_screen(&screens->part, key);
    if (screen->key == key) return screen;
    screen->key = key;
    make_screen(bvh, s, light, memory, id, &screens->part, screen);
    return screen;
}

// Darken a share's rays for which there is no screen; false when none is left.
inline int cast_on_share(const Bvh *bvh, const Surfaces *s, global const float *light, ShadowMemory *memory, const Bundle *bundle,
                         const Share *share, Darkness *darkness)
{
    float lo[3], hi[3];
    const float2 z = facet_depths(share->facet, share->over);
    bundle_bounds(bundle, share->over, z.x, z.y, lo, hi);
    if (turned_away(share->facet, bundle, share->over, light, lo, hi)) return 0;
    Facet facet;
    prepare_facet(s, &memory->screens.bundle, share->id, 0.0f, &facet);
    const Seen seen = see_triangle(s, &memory->screens.bundle, memory->screens.all, share->id, &facet);
    ShadowRays rays = shadow_rays(light, seen.lo, seen.hi);
    const Receiver receiver = make_receiver(bundle, share->facet, share->over, rays.apex);
    aim_at(&rays, lo, hi);
    Target target;
    target.own = share->id;
    target.receiver = &receiver;
    target.darkness = darkness;
    target.maker = 0;
    return darken(bvh, light, &rays, list_between(bvh, light, &memory->between), &memory->nearby, lo, hi, &target);
}

// How many of a share's rays, all of the block's or those that `ids` says, see light `number`; where some do, `wants`
// receives which.
inline int shadow_share(const Bvh *bvh, const Surfaces *s, int number, ShadowMemory *memory, const Bundle *bundle, const Share *share,
                         global const int *ids, global int *wants)
{
    global const float *light = s->lights + (OPEN_LIGHTS + number) * LIGHT;
    const Screens *screens = &memory->screens;
    const Screen *screen = find_screen(bvh, s, number, memory, share->id);
    if (screen->rows == 0) return ALL_RAYS;
    int left = 0;
    Darkness darkness;
    if (screen->rows > 0) {
        Rectangle over = share->over;
        over.x += screens->block.x;
        over.y += screens->block.y;
        darkness = none_dark(over, screens->block - HALF);
        left = cast_screen(&screens->part, screen, &darkness);
    } else if (screen->rows == NO_SCREEN) {
        darkness = none_dark(share->over, (float2)(-HALF));
        left = cast_on_share(bvh, s, light, memory, bundle, share, &darkness);
    }
    return left ? count_lit(&darkness, ids, share->id, wants) : NO_RAY;
}
#endif

// Take from `wants` the rays of a block that cannot see the light.
inline void shadow_block(const Bvh *bvh, global const float *light, ShadowMemory *memory, const Bundle *bundle,
                         global const int *ids, global const float *point, global int *wants)
{
    float lo[3], hi[3];
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE((vi)(0), memory->seeing + at);
    Target target;
#if OUTER == 1
    target.own = -1;
    target.maker = 0;
#endif
    const LeafList *list = list_between(bvh, light, &memory->between);
    target.seen = memory->seen;
    target.ids = ids;
    target.open = memory->open;
    while (next_span(bundle, point, wants, memory->open, lo, hi)) {
        const ShadowRays rays = shadow_rays(light, lo, hi);
        target.view = make_light_view(&rays);
        if (see_from_light(&rays, point, memory->open, &target.view, &target.strips, memory->seen))
            darken(bvh, light, &rays, list, &memory->nearby, lo, hi, &target);
        else
            shadow_rays_singly(bvh, light, list, &memory->nearby, ids, point, memory->open);
        for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(VLOAD(memory->seeing + at) | VLOAD(memory->open + at), memory->seeing + at);
    }
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(VLOAD(memory->seeing + at), wants + at);
}
#endif

#endif
