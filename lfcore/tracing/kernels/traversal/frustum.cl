// What boxes are tested against: the interval of x and of y that a set of rays reaches at depth z,
//     [ox_lo + z dx_lo - |hx + z gx| - |hu + z gu|, ox_hi + z dx_hi + |hx + z gx| + |hu + z gu|]
// Its upper bound is convex in z and its lower bound concave, so looking at the two ends of a box's
// depth range is enough, also across the point where the rays cross.
//
// Source of packets that traverse by their bounds: A. Reshetov, A. Soupikov, J. Hurley, "Multi-
// Level Ray Tracing Algorithm", SIGGRAPH 2005; of packets: I. Wald et al., "Interactive Rendering
// with Coherent Ray Tracing", Eurographics 2001.
#pragma once
#include "tree.cl"

// Along one axis: origins and directions of the centre rays, and half extents of the inner grid.
typedef struct { float o_lo, o_hi, d_lo, d_hi, h, g; } Interval;
typedef struct {
    Interval x, y;
    float hu, gu;  // half extents of the elements of a block, the same along both axes
} Frustum;

inline Interval widened(Interval a, float hu, float gu)
{
    const float o = FRUSTUM_SLACK * (max(fabs(a.o_lo), fabs(a.o_hi)) + fabs(a.h) + fabs(hu));
    const float d = FRUSTUM_SLACK * (max(fabs(a.d_lo), fabs(a.d_hi)) + fabs(a.g) + fabs(gu));
    a.o_lo -= o;
    a.o_hi += o;
    a.d_lo -= d;
    a.d_hi += d;
    return a;
}

// What holds all rays between two bundles of the same steps and half_extent.
inline Frustum make_frustum(const Bundle *lo, const Bundle *hi)
{
    const float half_extent = lo->half_extent;
    const float hu = OUTER_HALF * lo->a, gu = OUTER_HALF * lo->b;
    const Interval x = {lo->ox, hi->ox, lo->dx, hi->dx, half_extent * lo->sx, half_extent * lo->tx};
    const Interval y = {lo->oy, hi->oy, lo->dy, hi->dy, half_extent * lo->sy, half_extent * lo->ty};
    return (Frustum){widened(x, hu, gu), widened(y, hu, gu), hu, gu};
}

// Half of what an axis spans at depth z, of the half extents of an inner grid and of elements.
inline vf half_span(vf z, float h, float g, float hu, float gu)
{
    const vf inner = fabs(fma(z, (vf)(g), (vf)(h)));
    return OUTER > 1 ? inner + fabs(fma(z, (vf)(gu), (vf)(hu))) : inner;
}

// Mask of boxes that lie beside an interval at both ends of their depths.
inline vi beside_interval(const Frustum *f, const Interval *a, vf lo, vf hi, vf z0, vf z1)
{
    const vf w0 = half_span(z0, a->h, a->g, f->hu, f->gu);
    const vf w1 = half_span(z1, a->h, a->g, f->hu, f->gu);
    const vf d_hi = a->d_hi, d_lo = a->d_lo;
    return GT(lo, max(fma(z0, d_hi, a->o_hi + w0), fma(z1, d_hi, a->o_hi + w1))) |
           LT(hi, min(fma(z0, d_lo, a->o_lo - w0), fma(z1, d_lo, a->o_lo - w1)));
}

// Mask of LANES boxes that the rays may meet nearer than z_far.
inline vi frustum_meets(const Frustum *f, global const Boxes *b, float z_far)
{
    const vf z_lo = VLOAD(b->low[2]), z1 = VLOAD(b->high[2]), z0 = max(z_lo, (vf)(0.0f));
    return ~(beside_interval(f, &f->x, VLOAD(b->low[0]), VLOAD(b->high[0]), z0, z1) |
             beside_interval(f, &f->y, VLOAD(b->low[1]), VLOAD(b->high[1]), z0, z1) |
             LE(z1, (vf)(0.0f)) | GT(z_lo, (vf)(z_far)));
}
