// Moving boxes: a ray is the moving box of its origin; the shaft between hit points and a light is
// the volume that their box passes on its way along the light's direction, or into the point light.
//
// Source of shafts: E. A. Haines, J. R. Wallace, "Shaft Culling for Efficient Ray-Cast Radiosity",
// 1991.
#pragma once
#include "block.cl"
#include "one_ray.cl"

// At time t the box is [lo + t / inverse_lo, hi + t / inverse_hi]; a side with inverse 0 rests.
typedef struct { float3 lo, hi, inverse_lo, inverse_hi; } Sweep;

inline float3 inverse_rate(float3 rate)
{
    return select(1.0f / rate, (float3)(0.0f), fabs(rate) < NOTHING_LEFT);
}
inline Sweep make_sweep(float3 lo, float3 hi, float3 rate_lo, float3 rate_hi)
{
    return (Sweep){lo, hi, inverse_rate(rate_lo), inverse_rate(rate_hi)};
}

// `light` is a point, reached at time 1, or the direction towards it.  The box has a margin,
// because rounding may move an occluder in front of a hit point.
inline Sweep make_shaft(float3 light, int is_point, const Box *box)
{
    const float3 lo = vload3(0, box->lo), hi = vload3(0, box->hi);
    const float3 most = max(max(fabs(lo), fabs(hi)), is_point ? fabs(light) : 0.0f);
    const float margin = LIGHT_SPACE_ERROR * largest_component(most);
    return make_sweep(lo - margin, hi + margin, light - (is_point ? lo : 0.0f),
                      light - (is_point ? hi : 0.0f));
}

// Mask of LANES ranges that the box overlaps before `until`; `near` receives the
// time at which the overlap begins.
inline vi sweep_overlaps_ranges(const Sweep *s, const Ranges *ranges, float until, vf *near)
{
    vf from = 0.0f, to = until;
    vi miss = GT(ranges->low[0], ranges->high[0]);  // an empty child of a node
    for (int k = 0; k < 3; ++k) {
        const float rise = axis(s->inverse_hi, k), leave = axis(s->inverse_lo, k);
        const vf above = ranges->low[k] - axis(s->hi, k);
        const vf below = ranges->high[k] - axis(s->lo, k);
        if (rise > 0.0f) from = max(from, above * rise);
        else if (rise < 0.0f) to = min(to, above * rise * SWEEP_SLACK);
        else miss |= GT(above, (vf)(0.0f));
        if (leave > 0.0f) to = min(to, below * leave * SWEEP_SLACK);
        else if (leave < 0.0f) from = max(from, below * leave);
        else miss |= LT(below, (vf)(0.0f));
    }
    *near = from;
    return LE(from, to) & ~miss;
}

// LANES boxes of a node, from `lane` on.
inline Ranges box_ranges(global const Boxes *boxes, int lane)
{
    Ranges r;
    for (int k = 0; k < 3; ++k) {
        r.low[k] = VLOAD(boxes->low[k] + lane);
        r.high[k] = VLOAD(boxes->high[k] + lane);
    }
    return r;
}

// Likewise of boxes and a ray that is parallel to no side of them.
inline vi ray_overlaps(const Sweep *s, global const Boxes *boxes, int lane, float until, vf *near)
{
    const Ranges r = box_ranges(boxes, lane);
    vf from = 0.0f, to = FAR;
    for (int k = 0; k < 3; ++k) {
        const float inverse = axis(s->inverse_lo, k), at = axis(s->lo, k);
        const vf low = r.low[k], high = r.high[k];
        from = max(from, ((inverse < 0.0f ? high : low) - at) * inverse);
        to = min(to, ((inverse < 0.0f ? low : high) - at) * inverse);
    }
    *near = from;
    return LE(from, min(to * SWEEP_SLACK, (vf)(until)));
}

// Likewise of boxes, and of the triangles of a leaf.
inline vi sweep_overlaps(const Sweep *s, global const Boxes *boxes, int lane, float until, vf *near)
{
    const Ranges r = box_ranges(boxes, lane);
    return sweep_overlaps_ranges(s, &r, until, near);
}
inline vi sweep_overlaps_leaf(const Sweep *s, global const Leaf *leaf, int lane, float until)
{
    Ranges r;
    vf near;
    for (int k = 0; k < 3; ++k) {
        const Triple x = {VLOAD(leaf->corner[0][k] + lane), VLOAD(leaf->corner[1][k] + lane),
                          VLOAD(leaf->corner[2][k] + lane)};
        r.low[k] = least3(x);
        r.high[k] = most3(x);
    }
    return sweep_overlaps_ranges(s, &r, until, &near);
}
