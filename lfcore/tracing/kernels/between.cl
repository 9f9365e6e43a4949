// What may stand between a beam and a light, gathered when it is first asked for.
#ifndef LFCORE_BETWEEN_CL
#define LFCORE_BETWEEN_CL
#include "occluders.cl"
#include "beam.cl"

#define SHADOW_LIST 512

typedef struct {
    const Rays *rays;           // the beam, and what it sees
    const BeamWork *work;
    global const float *z;
    global const int *ids;
    LeafList list;              // leaves between a single light and all of that, where it could hold them
    int asked, complete;        // whether it was filled, and holds all
} Between;

inline void enter_beam(const Rays *rays, const BeamWork *work, global const float *z, global const int *ids, Between *between)
{
    between->rays = rays;
    between->work = work;
    between->z = z;
    between->ids = ids;
    between->asked = between->complete = 0;
}

// Depths between which a block sees anything; the second is less than the first if it sees nothing.
inline float2 seen_depths(const BlockState *state, global const float *z, global const int *ids)
{
    if (state->cover == BUFFERED) {
        vf low = FAR, high = 0.0f;
        for (int at = 0; at < BLOCK_RAYS; at += LANES) {
            const vf depth = VLOAD(z + at);
            low = min(low, depth);
            high = pick(high, max(high, depth), GE(VLOAD(ids + at), (vi)(0)));
        }
        return (float2)(row_min(low), row_max(high));
    }
    float2 seen = (float2)(FAR, -FAR);
#if SHARED
    if (state->divided) {
        Rectangle over;
        for (int k = 0; k < state->parts->count; ++k) {
            global const Part *p = state->parts->of + k;
            around_rays(p->rays, BLOCK, &over);
            const float2 depths = corner_depths(p->over, p->under, over);
            seen = (float2)(min(seen.x, depths.x), max(seen.y, depths.y));
        }
        if (state->cover == NOTHING || !around_rays(state->parts->open, BLOCK, &over)) return seen;
        const float2 depths = corner_depths(state->over, state->under, over);
        return (float2)(min(seen.x, depths.x), max(seen.y, depths.y));
    }
#endif
    return state->cover == NOTHING ? seen : (float2)(state->z_near, state->z_far);
}

// Bounds of everything that the beam sees.
inline int beam_bounds(const Between *b, float *lo, float *hi)
{
    const BeamWork *work = b->work;
    for (int k = 0; k < 3; ++k) { lo[k] = FAR; hi[k] = -FAR; }
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        const BlockState *state = work->block + block;
        if (state->z_far < 0.0f) continue;
        const float2 seen = seen_depths(state, b->z + block * BLOCK_RAYS, b->ids + block * BLOCK_RAYS);
        const float near = seen.x, far = seen.y;
        if (!(near <= far)) continue;
        const Bundle bundle = block_bundle(b->rays, work, block);
        const Beam beam = block_beam(&bundle);
        const float wx0 = fabs(fma(near, beam.gx, beam.hx)) + fabs(fma(near, beam.gu, beam.hu));
        const float wx1 = fabs(fma(far, beam.gx, beam.hx)) + fabs(fma(far, beam.gu, beam.hu));
        const float wy0 = fabs(fma(near, beam.gy, beam.hy)) + fabs(fma(near, beam.gu, beam.hu));
        const float wy1 = fabs(fma(far, beam.gy, beam.hy)) + fabs(fma(far, beam.gu, beam.hu));
        lo[0] = min(lo[0], min(fma(near, beam.dx_lo, beam.ox_lo - wx0), fma(far, beam.dx_lo, beam.ox_lo - wx1)));
        hi[0] = max(hi[0], max(fma(near, beam.dx_hi, beam.ox_hi + wx0), fma(far, beam.dx_hi, beam.ox_hi + wx1)));
        lo[1] = min(lo[1], min(fma(near, beam.dy_lo, beam.oy_lo - wy0), fma(far, beam.dy_lo, beam.oy_lo - wy1)));
        hi[1] = max(hi[1], max(fma(near, beam.dy_hi, beam.oy_hi + wy0), fma(far, beam.dy_hi, beam.oy_hi + wy1)));
        lo[2] = min(lo[2], near);
        hi[2] = max(hi[2], far);
    }
    return lo[2] <= hi[2];
}

// All leaves between the beam and a light that is the only one that casts shadows, or 0 where they are too many to list.
inline const LeafList *list_between(const Bvh *bvh, global const float *light, Between *between)
{
#if SHADOW_LIGHTS == 1 && !SCATTERED
    if (!between->asked) {
        float lo[3], hi[3];
        LeafList *list = &between->list;
        list->count = 0;
        between->asked = between->complete = 1;
        if (beam_bounds(between, lo, hi)) {
            const Shaft shaft = make_shaft(light, lo, hi);
            Walk walk;
            start_walk(&walk);
            gather_shaft(bvh, &shaft, &walk, list);
            between->complete = walk.size == 0;
        }
    }
#endif
    return between->complete ? &between->list : 0;
}

#endif
