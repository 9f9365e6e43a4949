// Bundles: blocks of 16 x 16 rays described by a few affine coefficients.
//
// Ray (i, j) of a bundle, counted from its centre, is at depth z
//     x(z) = (ox + i sx) + z (dx + i tx)        y(z) = (oy + j sy) + z (dy + j ty)
// whatever its camera: lens samples of one pixel (tx = -delta sx), pixels of one lens sample or
// data camera (sx = 0).
#ifndef LFCORE_BUNDLE_CL
#define LFCORE_BUNDLE_CL
#include "lanes.cl"

#define BLOCK 16
#define BLOCK_RAYS (BLOCK * BLOCK)
// Half the extent of the rays in use, from the block's centre: 7.5, or less where the whole inner grid
// is smaller than a block, so that the block is centred on rays that exist.
#ifndef HALF
#define HALF 7.5f
#endif
// Whether rays are followed one by one: chosen by the host from how much stands in the way of a block.
#ifndef SCATTERED
#define SCATTERED 0
#endif
#define FAR 3.0e38f
#define NODE_WIDTH 16
#define UNUSED 0x7fffffff

typedef struct {
    float ox, oy, dx, dy;  // centre ray
    float sx, sy;          // step of the origin per column, per row
    float tx, ty;          // step of the direction per column, per row
} Bundle;

// What a box is tested against: the interval of x (and y) that a set of rays can reach at depth z,
//     [ox_lo + z dx_lo - |hx + z gx|, ox_hi + z dx_hi + |hx + z gx|]
// Its upper bound is convex in z and its lower bound concave, so looking at the two ends of a box's
// depth range is enough, also across the point where the rays cross.
typedef struct {
    float ox_lo, ox_hi, dx_lo, dx_hi, hx, gx;
    float oy_lo, oy_hi, dy_lo, dy_hi, hy, gy;
} Beam;

// Widens by a few ulp of every term: culling must never lose a ray that the triangle test would hit.
inline Beam pad_beam(Beam b)
{
    const float eps = 1.0e-6f;
    const float o_x = eps * (max(fabs(b.ox_lo), fabs(b.ox_hi)) + fabs(b.hx));
    const float d_x = eps * (max(fabs(b.dx_lo), fabs(b.dx_hi)) + fabs(b.gx));
    const float o_y = eps * (max(fabs(b.oy_lo), fabs(b.oy_hi)) + fabs(b.hy));
    const float d_y = eps * (max(fabs(b.dy_lo), fabs(b.dy_hi)) + fabs(b.gy));
    b.ox_lo -= o_x; b.ox_hi += o_x; b.dx_lo -= d_x; b.dx_hi += d_x;
    b.oy_lo -= o_y; b.oy_hi += o_y; b.dy_lo -= d_y; b.dy_hi += d_y;
    return b;
}

inline Beam block_beam(const Bundle *r)
{
    Beam b;
    b.ox_lo = b.ox_hi = r->ox; b.dx_lo = b.dx_hi = r->dx;
    b.oy_lo = b.oy_hi = r->oy; b.dy_lo = b.dy_hi = r->dy;
    b.hx = HALF * r->sx; b.gx = HALF * r->tx;
    b.hy = HALF * r->sy; b.gy = HALF * r->ty;
    return pad_beam(b);
}

// Mask of the LANES boxes (structure of arrays, row pitch `pitch`) that the beam may meet nearer
// than z_far.
inline vi beam_meets(const Beam *b, global const float *boxes, int pitch, float z_far)
{
    const vf lo_x = VLOAD(boxes), lo_y = VLOAD(boxes + pitch), lo_z = VLOAD(boxes + 2 * pitch);
    const vf hi_x = VLOAD(boxes + 3 * pitch), hi_y = VLOAD(boxes + 4 * pitch), z1 = VLOAD(boxes + 5 * pitch);
    const vf z0 = max(lo_z, (vf)(0.0f));
    const vf w0 = fabs(fma(z0, (vf)(b->gx), (vf)(b->hx))), w1 = fabs(fma(z1, (vf)(b->gx), (vf)(b->hx)));
    vi miss = GT(lo_x, max(fma(z0, (vf)(b->dx_hi), b->ox_hi + w0), fma(z1, (vf)(b->dx_hi), b->ox_hi + w1)));
    miss |= LT(hi_x, min(fma(z0, (vf)(b->dx_lo), b->ox_lo - w0), fma(z1, (vf)(b->dx_lo), b->ox_lo - w1)));
    const vf y0 = fabs(fma(z0, (vf)(b->gy), (vf)(b->hy))), y1 = fabs(fma(z1, (vf)(b->gy), (vf)(b->hy)));
    miss |= GT(lo_y, max(fma(z0, (vf)(b->dy_hi), b->oy_hi + y0), fma(z1, (vf)(b->dy_hi), b->oy_hi + y1)));
    miss |= LT(hi_y, min(fma(z0, (vf)(b->dy_lo), b->oy_lo - y0), fma(z1, (vf)(b->dy_lo), b->oy_lo - y1)));
    miss |= LE(z1, (vf)(0.0f)) | GT(lo_z, (vf)(z_far));
    return ~miss;
}

#endif
