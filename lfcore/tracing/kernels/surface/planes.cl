// Plane equations: what a triangle interpolates over a block, as quotients of affine functions.
#pragma once
#include "texture.cl"

// What corners have, side by side.  Colours are differences from the first corner's, so that equal
// corners give just their colour.
#define SLOTS 8
enum { NORMAL = 0, COORDINATES = 3, TINT = 5 };

#define TANGENT_WORDS (PHYSICAL ? 4 : 1)

typedef struct {
    Affine weights;                        // sum of the barycentric weights
    Affine numerator, denominator;         // depth is their quotient
    float slot[OUTER > 1 ? 6 : 3][SLOTS];  // attributes times the weights, term by term
    // Geometric, towards the viewer, unless normals are smooth.
    float normal[3];
    float first[3];                        // colour of the first corner
    // Of PHYSICAL scenes: the direction of u, and the sign of v's beside it for a viewer; else
    // nothing.
    float tangent[TANGENT_WORDS];
    int key;                               // shading key
#if BAKED
    Affine light[3];  // each corner's weight; of one cell of a grid, red, green and blue times weights
    int grid[3];      // first point in front and behind, and cells along an edge; 0: of one cell
#endif
} PlaneEquations;

inline Affine slot_affine(global const PlaneEquations *p, int slot)
{
    Affine f;
    for (int k = 0; k < AFFINE_TERMS; ++k) f.of[k] = p->slot[k][slot];
    return f;
}

// An edge function of the weights, of corners sheared to the centre ray.
inline Affine weight_function(float3 p, float3 q, const Bundle *r)
{
    const float3 g = p - q, c = 0.5f * edge_normal(p, q);
    const Affine along = stepped_affine(c.z, c.x, c.y, r->tx, r->ty, r->b);
    Affine e = stepped_affine(0.0f, g.y, -g.x, r->sx, r->sy, r->a);
    for (int k = 0; k < AFFINE_TERMS; ++k) e.of[k] += along.of[k];
    if (OUTER > 1) e.of[BILINEAR] = g.z * (r->sx * r->b - r->a * r->tx);
    return e;
}

// What corner `k` of a triangle has.
inline float8 corner_slots(global const float *attributes, int k)
{
    float8 a = 0.0f;
    if (SMOOTH) a.s012 = vload3(k, attributes);
    attributes += 9 * SMOOTH;
    if (TEXTURED) a.s34 = vload2(k, attributes);
    attributes += 6 * TEXTURED;
    if (VERTEX_COLOURS) a.s567 = vload3(k, attributes) - vload3(0, attributes);
    return a;
}

// Set up a triangle for a block; `pixel` is the tangent between neighbouring pixels.
inline void set_up_planes(const Scene *s, const Bundle *r, int triangle, float pixel,
                          global PlaneEquations *out)
{
    const float3 p = corner(s, triangle, 0), q = corner(s, triangle, 1), w = corner(s, triangle, 2);
    const float3 shear = (float3)(r->dx, r->dy, 0.0f), origin = (float3)(r->ox, r->oy, 0.0f);
    const float3 v[3] = {p - origin - p.z * shear, q - origin - q.z * shear,
                         w - origin - w.z * shear};
    const Affine e[3] = {weight_function(v[1], v[2], r), weight_function(v[2], v[0], r),
                         weight_function(v[0], v[1], r)};
    for (int k = 0; k < AFFINE_TERMS; ++k)
        out->weights.of[k] = e[0].of[k] + e[1].of[k] + e[2].of[k];
#if BAKED
    for (int k = 0; k < 3; ++k) out->light[k] = e[k];
#endif
    float3 n = cross_product(v[1] - v[0], v[2] - v[0]);
    const float side = n.z < 0.0f ? -1.0f : 1.0f;
    n *= side;
    const float offset = inner_product(n, v[0]);
    out->numerator = stepped_affine(offset, -n.x, -n.y, r->sx, r->sy, r->a);
    out->denominator = stepped_affine(n.z, n.x, n.y, r->tx, r->ty, r->b);
    const float weights = out->weights.of[ONE];
    if (!SMOOTH) {
        // The sum of the weights is n . D: negative when the corners turn towards the viewer.
        const float sign = weights < 0.0f ? -1.0f : 1.0f;
        vstore3(-sign * direction_of(cross_product(q - p, w - p)), 0, out->normal);
    }
    if (PHYSICAL) {
        const float3 towards = -side * cross_product(q - p, w - p);
        vstore4(find_tangent(s, triangle, q - p, w - p, towards), 0, out->tangent);
    }
    if (ATTRIBUTES) {
        global const float *at = attributes_of(s, triangle);
        const float8 a = corner_slots(at, 0), b = corner_slots(at, 1), c = corner_slots(at, 2);
        for (int k = 0; k < AFFINE_TERMS; ++k)
            vstore8(a * e[0].of[k] + b * e[1].of[k] + c * e[2].of[k], 0, out->slot[k]);
        if (VERTEX_COLOURS) vstore3(vload3(0, at + 9 * SMOOTH + 6 * TEXTURED), 0, out->first);
    }
    out->key = s->material_ids[triangle] * MIP_LEVELS;
    if (!TEXTURED) return;
    const float depth = (p.z * e[0].of[ONE] + q.z * e[1].of[ONE] + w.z * e[2].of[ONE]) / weights;
    out->key += mip_level(s, triangle, weights, depth * pixel);
}

// Whether all rays in a rectangle of a block of one element see the triangle from one side.
inline int is_one_sided(Affine denominator, Rectangle at)
{
    const float x = at.x * denominator.of[X], y = at.y * denominator.of[Y];
    const float one = denominator.of[ONE];
    const float error = HIT_SLACK * (fabs(one) + fabs(x) + fabs(y));
    const float spread = at.half_width * fabs(denominator.of[X]) +
                         at.half_height * fabs(denominator.of[Y]);
    return one + x + y > error + BOUND_SLACK * spread;
}
