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
    return state->cover == NOTHING ? seen : (float2)(state->z_near, state->z_far);
}

// Bounds of everything that the beam sees.  Of a block the ends of its depth bound it, along x, then along y;
// it is widened by a few ulp of every term, as beams are.
inline int beam_bounds(const Between *b, float *lo, float *hi)
{
    const Rays *rays = b->rays;
    const BeamWork *work = b->work;
    const float4 origin_step = rays->step.xxyy, slope_step = rays->step.zzww;
    const float4 wide_origin = HALF * fabs(origin_step) + OUTER_HALF * fabs(rays->outer.x);
    const float4 wide_slope = HALF * fabs(slope_step) + OUTER_HALF * fabs(rays->outer.y);
    float4 least = FAR, most = -FAR;
    float near = FAR, far = -FAR;
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        const BlockState *state = work->block + block;
        if (state->z_far < 0.0f) continue;
        const float2 seen = seen_depths(state, b->z + block * BLOCK_RAYS, b->ids + block * BLOCK_RAYS);
        if (!(seen.x <= seen.y)) continue;
        const Bundle r = block_bundle(rays, work, block);
        const float4 depth = seen.xyxy, origin = (float4)(r.ox, r.ox, r.oy, r.oy), slope = (float4)(r.dx, r.dx, r.dy, r.dy);
        const float4 middle = fma(depth, slope, origin);
        const float4 reach = HALF * fabs(fma(depth, slope_step, origin_step)) +
                             OUTER_HALF * fabs(fma(depth, (float4)(r.b), (float4)(r.a))) +
                             1.0e-6f * fma(depth, fabs(slope) + wide_slope, fabs(origin) + wide_origin);
        least = min(least, middle - reach);
        most = max(most, middle + reach);
        near = min(near, seen.x);
        far = max(far, seen.y);
    }
    lo[0] = min(least.x, least.y); lo[1] = min(least.z, least.w); lo[2] = near;
    hi[0] = max(most.x, most.y); hi[1] = max(most.z, most.w); hi[2] = far;
    return near <= far;
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
