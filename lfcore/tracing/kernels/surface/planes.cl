// The surfaces and lights of a scene, as the host packs them, and plane equations: what a triangle
// interpolates over a block, as quotients of affine functions.
#pragma once
#include "visibility.cl"

#define TEXTURED ((TEXTURES & TEXTURED_BIT) != 0)
// Attributes of a triangle's corners: normals, texture coordinates, colours, as far as a scene has
// them.
#define ATTRIBUTES (9 * SMOOTH + 6 * TEXTURED + 9 * VERTEX_COLOURS)
// Materials of metal and roughness or of several textures: a bit of TEXTURES.
#define PHYSICAL ((TEXTURES & PHYSICAL_BIT) != 0)

typedef struct {
    global const float *corners;     // (T, 9)
    global const float *attributes;  // (T, ATTRIBUTES)
    global const int *material_ids;  // (T,)
    global const MaterialRecord *materials;
    global const LightRecord *lights;
    global const Level *levels;      // (textures, MIP_LEVELS)
    global const uint *texels;
    global const int *grids;         // (T, 3) see baked.cl
    global const float *light;       // (P, 3) of the points of all grids
    global const float *sky;         // (side, side, 3)
    const SceneArguments *numbers;
} Scene;

// Of a kernel's parameters.
#define MAKE_SCENE                                                                             \
    {.corners = corners, .attributes = attributes, .material_ids = material_ids,               \
     .materials = materials, .lights = lights, .levels = levels, .texels = texels,             \
     .grids = grids, .light = light, .sky = sky, .numbers = &scene_numbers}

inline float3 corner(const Scene *s, int triangle, int k)
{
    return vload3(k, s->corners + triangle * 9);
}
inline global const float *attributes_of(const Scene *s, int triangle)
{
    return s->attributes + (long)triangle * ATTRIBUTES;
}

// The slots of a corner's attributes.  Colours are differences from the first corner's, so that
// equal corners give exactly their colour.
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
    Affine light[3];  // each corner's weight; of one cell, red, green and blue times the weights
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

// The attributes of corner `k`.
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

// Set up a triangle for a block.
inline void set_up_planes(const Scene *s, const Bundle *r, int triangle,
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
    if (n.z < 0.0f) n = -n;
    const float offset = inner_product(n, v[0]);
    out->numerator = stepped_affine(offset, -n.x, -n.y, r->sx, r->sy, r->a);
    out->denominator = stepped_affine(n.z, n.x, n.y, r->tx, r->ty, r->b);
    if (!SMOOTH) {
        // The sum of the weights is n . D: negative when the corners turn towards the viewer.
        const float sign = out->weights.of[ONE] < 0.0f ? -1.0f : 1.0f;
        vstore3(-sign * direction_of(cross_product(q - p, w - p)), 0, out->normal);
    }
    if (ATTRIBUTES) {
        global const float *at = attributes_of(s, triangle);
        const float8 a = corner_slots(at, 0), b = corner_slots(at, 1), c = corner_slots(at, 2);
        for (int k = 0; k < AFFINE_TERMS; ++k)
            vstore8(a * e[0].of[k] + b * e[1].of[k] + c * e[2].of[k], 0, out->slot[k]);
        if (VERTEX_COLOURS) vstore3(vload3(0, at + 9 * SMOOTH + 6 * TEXTURED), 0, out->first);
    }
    out->key = s->material_ids[triangle] * MIP_LEVELS;
}
