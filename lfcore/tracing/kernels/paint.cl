// A beam's colours, block by block: see, shade, take away what lies in shadow.
#ifndef LFCORE_PAINT_CL
#define LFCORE_PAINT_CL
#include "shadows.cl"
#include "scattered.cl"
#include "beam.cl"
#include "share_colours.cl"

#ifndef SHADOW_LIST
#define SHADOW_LIST 0
#endif
#define SHADOWED (SHADOW_LIGHTS > 0)
#if SHADOWED && OUTER == 1
#define SCREEN_WORDS (OCCLUDER_WORDS * (POOL))
#else
#define SCREEN_WORDS 0
#endif
// A block that sees more triangles than this casts its shadow rays one by one: measured, one for two rays.
#define MANY_TRIANGLES (0.5f * (2.0f * HALF + 1.0f) * (2.0f * HALF + 1.0f) * OUTER * OUTER)

// A worker's own memory.
typedef struct {
    global float *z;         // depth buffers of the beam
    global int *ids;
    LeafList list;
#if SHADOW_LIGHTS
    ShadowMemory shadows;
#endif
    BlockColours colours;
#if OUTER == 1
    Cover cover;             // the triangle that covered a block last
#endif
} Easel;

#define EASEL_WORDS                                                                                    \
    (BEAM_BLOCKS * 2 * BLOCK_RAYS + 7 * LIST + 14 * SHADOW_LIST + SCREEN_WORDS +       \
     (3 + 8 * SHADOWED + 4 * SHADOW_LIGHTS) * BLOCK_RAYS)

// Divide `memory`, of EASEL_WORDS words.
inline Easel make_easel(global uint *memory)
{
    global uint *at = memory;
#define TAKE(type, count) (global type *)at; at += (count)
    Easel e;
    e.z = TAKE(float, BEAM_BLOCKS * BLOCK_RAYS);
    e.ids = TAKE(int, BEAM_BLOCKS * BLOCK_RAYS);
    e.list.boxes = TAKE(float, 6 * LIST);
    e.list.leaf = TAKE(int, LIST);
    e.list.pitch = LIST;
#if SHADOW_LIGHTS
    e.shadows.between.list.boxes = TAKE(float, 6 * SHADOW_LIST);
    e.shadows.between.list.leaf = TAKE(int, SHADOW_LIST);
    e.shadows.nearby.boxes = TAKE(float, 6 * SHADOW_LIST);
    e.shadows.nearby.leaf = TAKE(int, SHADOW_LIST);
    e.shadows.between.list.pitch = e.shadows.nearby.pitch = SHADOW_LIST;
    e.shadows.open = TAKE(int, BLOCK_RAYS);
    e.shadows.seeing = TAKE(int, BLOCK_RAYS);
    e.shadows.seen = TAKE(float, 3 * BLOCK_RAYS);
#if OUTER == 1
    global float *pool = TAKE(float, SCREEN_WORDS);
    make_screens(pool, &e.shadows.screens);
#endif
#endif
    e.colours.base = TAKE(float, 3 * BLOCK_RAYS);
    e.colours.point = TAKE(float, 3 * SHADOWED * BLOCK_RAYS);
    e.colours.lit = TAKE(float, 3 * SHADOW_LIGHTS * BLOCK_RAYS);
    e.colours.wants = TAKE(int, SHADOW_LIGHTS * BLOCK_RAYS);
#undef TAKE
    return e;
}

// See the whole beam.
inline void see_beam(const Bvh *bvh, const Surfaces *s, const Rays *rays, BeamWork *work, Easel *e)
{
    see(bvh, rays, work, &e->list, e->z, e->ids);
#if OUTER == 1
    e->cover.id = -1;
#endif
#if SHADOW_LIGHTS
    enter_beam(rays, work, e->z, e->ids, &e->shadows.between);
#if OUTER == 1
    e->shadows.screens.element = -1;
#endif
#endif
}

// What lanes beside the inner grid see is of no use: neither shaded nor shadowed.  Elements that are not there
// are: what a ray's neighbours see decides how its shadow is found, and must not depend on how a job is cut.
inline void crop_block(const Rays *rays, int2 where, global int *ids)
{
    const int columns = rays->columns - where.x, rows = rays->rows - where.y;
    if (columns >= INNER && rows >= INNER) return;
    for (int at = 0; at < BLOCK_RAYS; ++at)
        if (at % INNER >= columns || at / BLOCK % INNER >= rows) ids[at] = -1;
}

#if OUTER == 1
// Blocks of one element on few triangles: what the lights reach is found before anything is lit.

// Find out how many of a share's rays see each light that casts shadows.
inline void look_for_lights(const Bvh *bvh, const Surfaces *s, const Bundle *bundle, Share *share, global const int *ids, Easel *e)
{
#if SHADOW_LIGHTS
    for (int k = 0; k < SHADOW_LIGHTS; ++k)
        share->seeing[k] = shadow_share(bvh, s, k, &e->shadows, bundle, share, ids, e->colours.wants + k * BLOCK_RAYS);
#endif
}

// A block that lies on triangle `id`.
inline void paint_cover(const Bvh *bvh, const Surfaces *s, const Rays *rays, const BeamWork *work, int block, const Bundle *bundle, int id,
                        float pixel, Easel *e)
{
    Facet facet;
    const int sided = cover_block(s, rays, work, block, bundle, id, pixel, &e->cover, &facet);
    Share share = whole_block(id, &facet);
    look_for_lights(bvh, s, bundle, &share, 0, e);
    FacetSeries own;
    Painting p;
    p.share = &share;
    p.finish = read_finish(s, facet.finish);
    p.series = &e->cover.series;
    p.offset = block_offset(block);
    if (!sided || (SIDE > 1 && !is_smooth(p.series, &p.finish))) {
        facet_series(s, bundle, &facet, &share.over, &p.finish, share.seeing, &own);
        p.series = &own;
        p.offset = 0.0f;
    }
    paint_share(s, bundle, &p, 0, &e->colours);
}

// A block that few triangles share.
inline void paint_shared(const Bvh *bvh, const Surfaces *s, const Bundle *bundle, Shares *shares, global const int *ids, Easel *e)
{
    for (int k = 0; k < shares->count; ++k) look_for_lights(bvh, s, bundle, shares->of + k, ids, e);
    paint_shares(s, bundle, shares, ids, &e->colours);
}
#endif

// A block of several triangles or elements, or between whose rays some meet nothing.
inline void paint_facets(const Bvh *bvh, const Surfaces *s, const Bundle *bundle, global const float *z, global const int *ids, float pixel,
                         Easel *e)
{
    Facets facets;
    shade_block(s, bundle, z, ids, pixel, &facets, &e->colours);
#if SHADOW_LIGHTS
    for (int k = 0; k < SHADOW_LIGHTS; ++k) {
        global int *wants = e->colours.wants + k * BLOCK_RAYS;
        global const float *light = s->lights + (OPEN_LIGHTS + k) * LIGHT;
        ShadowMemory *memory = &e->shadows;
        if (SCATTERED || facets.count > MANY_TRIANGLES)
            shadow_rays_singly(bvh, light, list_between(bvh, light, &memory->between), &memory->nearby, ids, e->colours.point, wants);
        else if (facets.count)
            shadow_block(bvh, light, memory, bundle, ids, e->colours.point, wants);
        for (int ray = 0; ray < BLOCK_RAYS; ray += LANES) {
            const vi open = VLOAD(wants + ray);
            for (int channel = 0; channel < 3; ++channel) {
                global float *sum = e->colours.base + channel * BLOCK_RAYS + ray;
                VSTORE(VLOAD(sum) + pick((vf)(0.0f), VLOAD(e->colours.lit + (3 * k + channel) * BLOCK_RAYS + ray), open), sum);
            }
        }
    }
#endif
}

#if OUTER == 1
// The triangle that all rays of a block meet, or -1.  One may have hidden all others after they had shared the block.
inline int only_triangle(const BlockState *state, global const int *ids)
{
    if (state->cover != BUFFERED) return state->cover;
    vi other = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) other |= ~EQ(VLOAD(ids + at), (vi)(ids[0]));
    return row_any(other) ? -1 : ids[0];
}

// Share out a block among the triangles that it meets; false where they are many, or some ray sees one edge-on.
inline int share_block(const Surfaces *s, const Rays *rays, const BeamWork *work, int block, const Bundle *bundle, float pixel, Easel *e,
                       Shares *shares)
{
    const int2 where = block_position(work, block);
    global int *ids = e->ids + block * BLOCK_RAYS;
    const int most = min(rays->columns, rays->rows) < DENSE ? CROWD : SHARES;
    crop_block(rays, where, ids);
    return share_out(s, bundle, ids, most, pixel, shares);
}
#endif

// Linear colours, not clamped, of one block of a beam that was seen: (3, BLOCK_RAYS) at colours.base.
inline void paint_block(const Bvh *bvh, const Surfaces *s, const Rays *rays, BeamWork *work, int block, float pixel, Easel *e)
{
    BlockState *state = work->block + block;
    const Bundle bundle = block_bundle(rays, work, block);
    global float *z = e->z + block * BLOCK_RAYS;
    global int *ids = e->ids + block * BLOCK_RAYS;
    if (state->cover == NOTHING) {
        shade_nothing(s, &e->colours);
        return;
    }
#if OUTER == 1
#if SHADOW_LIGHTS
    enter_element(rays, work, block, &e->shadows.screens);
#endif
#if SCATTERED
    crop_block(rays, block_position(work, block), ids);
#else
    const int only = only_triangle(state, ids);
    if (only >= 0) {
        paint_cover(bvh, s, rays, work, block, &bundle, only, pixel, e);
        return;
    }
    Shares shares;
    if (share_block(s, rays, work, block, &bundle, pixel, e, &shares)) {
        paint_shared(bvh, s, &bundle, &shares, ids, e);
        return;
    }
#endif
#else
    materialise(state, z, ids);
    crop_block(rays, block_position(work, block), ids);
#endif
    paint_facets(bvh, s, &bundle, z, ids, pixel, e);
}

#endif
