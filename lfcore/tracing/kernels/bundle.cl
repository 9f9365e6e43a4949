// Bundles: blocks of 16 x 16 rays described by a few affine coefficients.
//
// Ray (i, j) of a bundle, counted from its centre, is at depth z
//     x(z) = (ox + i sx) + z (dx + i tx)        y(z) = (oy + j sy) + z (dy + j ty)
// whatever its camera: lens samples of one pixel (tx = -delta sx), pixels of one lens sample or
// data camera (sx = 0).
//
// A block may span neighbouring elements, too: along each axis INNER rays of the inner grid times
// OUTER elements, u and v counted from their middle, of which each adds a to the origin and b to the
// direction.  Where lens samples and pixels are both few, such a block is far narrower in space than 16 x 16 of
// one kind, and meets far fewer triangles.
#ifndef LFCORE_BUNDLE_CL
#define LFCORE_BUNDLE_CL
#include "lanes.cl"

#define BLOCK 16
#define BLOCK_RAYS (BLOCK * BLOCK)
#ifndef OUTER
#define OUTER 1
#endif
#if OUTER == 4
#define INNER 4
#elif OUTER == 2
#define INNER 8
#else
#define INNER 16
#endif
#define OUTER_HALF (0.5f * (OUTER - 1))
// Half the extent of the inner rays in use, from the block's centre: (INNER - 1) / 2, or less where the
// whole inner grid is smaller than a block, so that the block is centred on rays that exist.
#ifndef HALF
#define HALF (0.5f * (INNER - 1))
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
    float a, b;            // step of origin and direction per element, along either axis
} Bundle;

// A row of LANES rays of a block, by their places on the inner grid and among the elements.
typedef struct {
    vf x;
    float y;
#if OUTER > 1
    vf u;
    float v;
#endif
} Row;

// The row that begins with ray `at`, a multiple of LANES.
inline Row row_at(int at)
{
    Row r;
#if OUTER > 1
    const vi column = TO_VI(IOTA) + at % BLOCK;
    r.x = TO_VF(column & (INNER - 1)) - HALF;
    r.u = TO_VF(column / INNER) - OUTER_HALF;
    r.y = (at / BLOCK) % INNER - HALF;
    r.v = at / BLOCK / INNER - OUTER_HALF;
#else
    r.x = IOTA + (at % BLOCK - HALF);
    r.y = at / BLOCK - HALF;
#endif
    return r;
}

#if OUTER > 1
inline vf row_ox(const Bundle *r, Row at) { return fma(at.u, (vf)(r->a), fma(at.x, (vf)(r->sx), (vf)(r->ox))); }
inline vf row_dx(const Bundle *r, Row at) { return fma(at.u, (vf)(r->b), fma(at.x, (vf)(r->tx), (vf)(r->dx))); }
inline float row_oy(const Bundle *r, Row at) { return fma(at.v, r->a, fma(at.y, r->sy, r->oy)); }
inline float row_dy(const Bundle *r, Row at) { return fma(at.v, r->b, fma(at.y, r->ty, r->dy)); }
#else
inline vf row_ox(const Bundle *r, Row at) { return fma(at.x, (vf)(r->sx), (vf)(r->ox)); }
inline vf row_dx(const Bundle *r, Row at) { return fma(at.x, (vf)(r->tx), (vf)(r->dx)); }
inline float row_oy(const Bundle *r, Row at) { return fma(at.y, r->sy, r->oy); }
inline float row_dy(const Bundle *r, Row at) { return fma(at.y, r->ty, r->dy); }
#endif

// A form over a block,
//     c + x i + y j + u p + v q + (y u - x v) k
// where only edge functions have k: D . (O x W) multiplies a step of the origin by one of the direction.
typedef struct {
    float c, i, j;
#if OUTER > 1
    float p, q, k;
#endif
} Form;

inline vf form_row(Form f, Row at)
{
#if OUTER > 1
    const float base = fma(at.v, f.q, fma(at.y, f.j, f.c)), along = fma(-at.v, f.k, f.i), across = fma(at.y, f.k, f.p);
    return fma(at.u, (vf)(across), fma(at.x, (vf)(along), (vf)(base)));
#else
    return fma(at.x, (vf)(f.i), (vf)(fma(at.y, f.j, f.c)));
#endif
}

// The same where k is 0.
inline vf flat_row(Form f, Row at)
{
#if OUTER > 1
    return fma(at.u, (vf)(f.p), fma(at.x, (vf)(f.i), (vf)(fma(at.v, f.q, fma(at.y, f.j, f.c)))));
#else
    return form_row(f, at);
#endif
}

// What a box is tested against: the interval of x (and y) that a set of rays can reach at depth z,
//     [ox_lo + z dx_lo - |hx + z gx| - |hu + z gu|, ox_hi + z dx_hi + |hx + z gx| + |hu + z gu|]
// Its upper bound is convex in z and its lower bound concave, so looking at the two ends of a box's
// depth range is enough, also across the point where the rays cross.
typedef struct {
    float ox_lo, ox_hi, dx_lo, dx_hi, hx, gx;
    float oy_lo, oy_hi, dy_lo, dy_hi, hy, gy;
    float hu, gu;  // of the elements of a block: the same along both axes
} Beam;

// Widens by a few ulp of every term: culling must never lose a ray that the triangle test would hit.
inline Beam pad_beam(Beam b)
{
    const float eps = 1.0e-6f;
    const float o_x = eps * (max(fabs(b.ox_lo), fabs(b.ox_hi)) + fabs(b.hx) + fabs(b.hu));
    const float d_x = eps * (max(fabs(b.dx_lo), fabs(b.dx_hi)) + fabs(b.gx) + fabs(b.gu));
    const float o_y = eps * (max(fabs(b.oy_lo), fabs(b.oy_hi)) + fabs(b.hy) + fabs(b.hu));
    const float d_y = eps * (max(fabs(b.dy_lo), fabs(b.dy_hi)) + fabs(b.gy) + fabs(b.gu));
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
    b.hu = OUTER_HALF * r->a; b.gu = OUTER_HALF * r->b;
    return pad_beam(b);
}

// Half of what a beam spans at depth z, along one axis of half extents h and g.
inline vf beam_reach(const Beam *b, float h, float g, vf z)
{
    const vf reach = fabs(fma(z, (vf)(g), (vf)(h)));
#if OUTER > 1
    return reach + fabs(fma(z, (vf)(b->gu), (vf)(b->hu)));
#else
    return reach;
#endif
}

// Mask of the LANES boxes (structure of arrays, row pitch `pitch`) that the beam may meet nearer
// than z_far.
inline vi beam_meets(const Beam *b, global const float *boxes, int pitch, float z_far)
{
    const vf lo_x = VLOAD(boxes), lo_y = VLOAD(boxes + pitch), lo_z = VLOAD(boxes + 2 * pitch);
    const vf hi_x = VLOAD(boxes + 3 * pitch), hi_y = VLOAD(boxes + 4 * pitch), z1 = VLOAD(boxes + 5 * pitch);
    const vf z0 = max(lo_z, (vf)(0.0f));
    const vf w0 = beam_reach(b, b->hx, b->gx, z0), w1 = beam_reach(b, b->hx, b->gx, z1);
    vi miss = GT(lo_x, max(fma(z0, (vf)(b->dx_hi), b->ox_hi + w0), fma(z1, (vf)(b->dx_hi), b->ox_hi + w1)));
    miss |= LT(hi_x, min(fma(z0, (vf)(b->dx_lo), b->ox_lo - w0), fma(z1, (vf)(b->dx_lo), b->ox_lo - w1)));
    const vf y0 = beam_reach(b, b->hy, b->gy, z0), y1 = beam_reach(b, b->hy, b->gy, z1);
    miss |= GT(lo_y, max(fma(z0, (vf)(b->dy_hi), b->oy_hi + y0), fma(z1, (vf)(b->dy_hi), b->oy_hi + y1)));
    miss |= LT(hi_y, min(fma(z0, (vf)(b->dy_lo), b->oy_lo - y0), fma(z1, (vf)(b->dy_lo), b->oy_lo - y1)));
    miss |= LE(z1, (vf)(0.0f)) | GT(lo_z, (vf)(z_far));
    return ~miss;
}

#endif
