// Blocks: 16 x 16 rays described by a few numbers, and affine functions over a block.
//
// Ray (i, j) of a bundle, counted from its centre, is at depth z
//     x(z) = (ox + i sx) + z (dx + i tx)        y(z) = (oy + j sy) + z (dy + j ty)
// whatever its camera: lens samples of one pixel (tx = -delta sx), pixels of one lens sample or
// data camera (sx = 0).
//
// A block may span neighbouring elements: along each axis INNER rays of the inner grid times OUTER
// elements.  u and v count the elements from their centre, and each adds a to the origin and b to
// the direction.  Where lens samples and pixels are both few, such a block is far narrower in space
// than 16 x 16 of either, and hits far fewer triangles.
#pragma once
#include "blocks.cl"
#include "numerics.cl"

#define INNER (BLOCK / OUTER)
#define OUTER_HALF (0.5f * (OUTER - 1))

typedef struct {
    float ox, oy, dx, dy;  // centre ray
    float sx, sy;          // step of the origin per column, per row
    float tx, ty;          // step of the direction per column, per row
    float a, b;            // step of origin and direction per element, along either axis
    float half_extent;     // half the number of inner steps, from first to last ray
} Bundle;

// Offsets of a row of LANES rays: x = i and y = j on the inner grid, u and v among the elements.
typedef struct { vf x; float y; vf u; float v; } Row;

// The row that begins with ray `at`, a multiple of LANES, of a bundle of `half_extent`.
inline Row row_at(int at, float half_extent)
{
    const vi column = TO_VI(IOTA) + at % BLOCK;
    Row r;
    r.x = TO_VF(column & (INNER - 1)) - half_extent;
    r.u = TO_VF(column / INNER) - OUTER_HALF;
    r.y = (at / BLOCK) % INNER - half_extent;
    r.v = at / BLOCK / INNER - OUTER_HALF;
    return r;
}

// base + x * inner + u * outer, vectors or scalars; a block of one element has no u.
#define AT_OFFSETS(x, u, base, inner, outer) \
    (OUTER > 1 ? fma(u, outer, fma(x, inner, base)) : fma(x, inner, base))

// Origins and directions of a row of rays.
inline vf row_ox(const Bundle *r, Row at) { return AT_OFFSETS(at.x, at.u, r->ox, r->sx, r->a); }
inline vf row_dx(const Bundle *r, Row at) { return AT_OFFSETS(at.x, at.u, r->dx, r->tx, r->b); }
inline float row_oy(const Bundle *r, Row at) { return AT_OFFSETS(at.y, at.v, r->oy, r->sy, r->a); }
inline float row_dy(const Bundle *r, Row at) { return AT_OFFSETS(at.y, at.v, r->dy, r->ty, r->b); }

inline Vec direction_row(const Bundle *r, Row row)
{
    return (Vec){row_dx(r, row), (vf)(row_dy(r, row)), (vf)(1.0f)};
}

// Terms of an affine function over a block: 1, x, y, and for several elements u, v and, of edge
// functions alone, y u - x v.  In blocks of one element U, V and BILINEAR are 0: they may be read as a term,
// whose value is not used.
enum { ONE, X, Y, U = OUTER > 1 ? 3 : 0, V = OUTER > 1 ? 4 : 0, BILINEAR = OUTER > 1 ? 5 : 0 };
#define AFFINE_TERMS (OUTER > 1 ? 6 : 3)
typedef struct { float term[AFFINE_TERMS]; } Affine;

// One function for each of LANES triangles.
typedef struct { vf term[AFFINE_TERMS]; } WideAffine;

// Values of an affine function without BILINEAR at a row of rays.
inline vf affine_row(Affine f, Row at)
{
    const float base = AT_OFFSETS(at.y, at.v, f.term[ONE], f.term[Y], f.term[V]);
    return AT_OFFSETS(at.x, at.u, base, f.term[X], f.term[U]);
}

// Rays between two columns and two rows of a block of one element, as a centre and half extents.
typedef struct { float x, y, half_width, half_height; } Rectangle;

// Values of an affine function at its four corners.
inline float4 corner_values(Affine f, Rectangle r)
{
    const float4 x = (float4)(-r.half_width, r.half_width, -r.half_width, r.half_width) + r.x;
    const float4 y = (float4)(-r.half_height, -r.half_height, r.half_height, r.half_height) + r.y;
    return fma(x, f.term[X], fma(y, f.term[Y], f.term[ONE]));
}
inline float least_of(float4 a) { return min(min(a.x, a.y), min(a.z, a.w)); }
inline float most_of(float4 a) { return max(max(a.x, a.y), max(a.z, a.w)); }

// Extremes of a quotient of affine functions, linear-fractional, are in the corners of a rectangle
// over which its denominator has one sign.
inline float2 quotient_range(Affine numerator, Affine denominator, Rectangle r)
{
    const float4 q = corner_values(numerator, r) / corner_values(denominator, r);
    return (float2)(least_of(q), most_of(q));
}
