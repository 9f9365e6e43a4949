// Plane equations: the quantities that a triangle interpolates over a block, as quotients of affine
// functions.
#pragma once
#include "hits.cl"
#include "visibility.cl"

typedef struct {
    Affine weights;                 // sum of the barycentric weights: twice n . D
    Affine numerator, denominator;  // depth is their quotient
    Affine slot[SLOTS];             // times the weights
    float first[3];                 // colour of the first corner
    int key;                        // shading key
    float tangent[PHYSICAL ? 4 : 1];  // direction of u, sign of v's beside it for a viewer
    int grid[3];  // of baked light: first point in front and behind, and cells along an edge
} PlaneEquations;

// The members of PlaneEquations up to `first`, in the same order, for LANES triangles.
typedef struct { WideAffine weights, numerator, denominator, slot[SLOTS]; vf first[3]; }
    WideEquations;

// Set up everything except attributes; `e` receives the corners' weights.
inline void set_up_lanes(const Scene *s, const Bundle *r, const TriangleRow *triangles,
                         WideAffine *e, WideEquations *out)
{
    Vec at[3], v[3];
    read_corners(s, triangles, at);
    for (int k = 0; k < 3; ++k) v[k] = at[k];
    shear_corners(r, v);
    out->weights = edge_functions(r, v, e);
    // The sum of the weights is negative when the corners turn towards the viewer.
    const vi flip = LT(out->weights.term[ONE], (vf)(0.0f)) & (vi)(0x80000000);
    depth_functions(r, v, flip, &out->numerator, &out->denominator);
    if (!SMOOTH) {
        Vec n = directions_of(geometric_normals(at));
        n = turn_vectors(n, ~flip & (vi)(0x80000000));
        const vf component[3] = {n.x, n.y, n.z};
        for (int k = 0; k < 3; ++k) out->slot[NORMAL + k] = (WideAffine){{component[k]}};
    }
}

// A slot as an affine function over the block, from the corners' weights `e`.
inline WideAffine set_up_slot(const Scene *s, const TriangleRow *triangles, int slot,
                              const WideAffine *e)
{
    vf at[3];
    read_slot(s, triangles, slot, at);
    WideAffine f;
    for (int k = 0; k < AFFINE_TERMS; ++k)
        f.term[k] = at[0] * e[0].term[k] + at[1] * e[1].term[k] + at[2] * e[2].term[k];
    return f;
}

// Values of an affine function with BILINEAR at a row of rays.
inline vf bilinear_row(Affine f, Row at)
{
    if (OUTER == 1) return affine_row(f, at);
    const float base = AT_OFFSETS(at.y, at.v, f.term[ONE], f.term[Y], f.term[V]);
    const float along = fma(-at.v, f.term[BILINEAR], f.term[X]);
    const float across = fma(at.y, f.term[BILINEAR], f.term[U]);
    return AT_OFFSETS(at.x, at.u, base, along, across);
}

// All slots of attributes.
inline void set_up_attributes(const Scene *s, const TriangleRow *triangles, const WideAffine *e,
                              WideEquations *out)
{
    for (int slot = FIRST_ATTRIBUTE; slot < WEIGHT; ++slot)
        out->slot[slot] = set_up_slot(s, triangles, slot, e);
    for (int slot = WEIGHT; slot < SLOTS; ++slot) out->slot[slot] = e[slot - WEIGHT + 1];
    read_first(s, triangles, out->first);
}

// A row of attributes, tangents and weights; `back` is the sign of n . D.
inline void interpolate_attributes(global const PlaneEquations *p, Row at, vi back, HitRow *s)
{
    const vf weights = affine_row(p->weights, at);
    for (int k = FIRST_ATTRIBUTE; k < WEIGHT; ++k) s->value[k] = bilinear_row(p->slot[k], at);
    // Seen from behind, a flat triangle's tangent is negated with its normal; smooth ones follow
    // later.
    const vi behind = sign_of(SMOOTH ? weights : -weights);
    for (int k = 0; k < 4 && PHYSICAL; ++k)
        s->value[TANGENT + k] = flip_sign(p->tangent[k], k < 3 ? behind : back);
    if (SLOTS == COORDINATES) return;
    const vf inverse = reciprocal(weights);
    for (int k = COORDINATES; k < TINT; ++k) s->value[k] *= inverse;
    for (int k = TINT; k < WEIGHT; ++k)
        s->value[k] = fma(inverse, s->value[k], (vf)(p->first[k - TINT]));
    for (int k = WEIGHT; k < SLOTS; ++k)
        s->value[k] = bilinear_row(p->slot[k], at) * (inverse * (float)p->grid[2]);
    // The corners turn to the viewer where the weights are negative.
    s->first = pick_int((vi)(p->grid[1]), (vi)(p->grid[0]), LT(weights, (vf)(0.0f)));
    s->side = p->grid[2];
}

// Add mip level and, for PHYSICAL, the tangent to a triangle's plane equations.
inline void set_up_texture(const Scene *s, int triangle, float pixel_pitch,
                           global PlaneEquations *p)
{
    const float3 at = corner(s, triangle, 0);
    const float3 a = corner(s, triangle, 1) - at, b = corner(s, triangle, 2) - at;
    if (PHYSICAL) {
        const float3 n = cross_product(a, b), towards = p->weights.term[ONE] < 0.0f ? n : -n;
        vstore4(find_tangent(s, triangle, a, b, towards), 0, p->tangent);
    }
    const float depth = p->numerator.term[ONE] / p->denominator.term[ONE];
    if (TEXTURED) p->key += mip_level(s, triangle, p->weights.term[ONE], depth * pixel_pitch);
}
