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
    global const uint *light;        // (P,) of the points of all grids
    global const float *sky;         // (side, side, 3)
    const SceneArguments *numbers;
} Scene;

inline float3 corner(const Scene *s, int triangle, int k)
{
    return vload3(k, s->corners + triangle * 9);
}
inline global const float *attributes_of(const Scene *s, int triangle)
{
    return s->attributes + (long)triangle * ATTRIBUTES;
}

// The slots of what a triangle interpolates.  Colours are differences from the first corner's, so
// that equal corners give exactly their colour.  Flat triangles have a normal for all rays, towards
// the viewer.
enum {
    NORMAL = 0,
    COORDINATES = 3,
    TINT = COORDINATES + 2 * TEXTURED,
    PLACE = TINT + 3 * VERTEX_COLOURS,  // weights of the second and the third corner
    SLOTS = PLACE + 2 * BAKED,
    FIRST_ATTRIBUTE = SMOOTH ? NORMAL : COORDINATES
};

#define TANGENT_WORDS (PHYSICAL ? 4 : 0)

typedef struct {
    Affine weights;                 // sum of the barycentric weights: twice n . D
    Affine numerator, denominator;  // depth is their quotient
    Affine slot[SLOTS];             // times the weights
    float first[3];                 // colour of the first corner
    int key;                        // shading key
    // The direction of u, and the sign of v's beside it for a viewer.
    float tangent[TANGENT_WORDS + !PHYSICAL];
    int grid[3];  // of baked light: first point in front and behind, and cells along an edge
    Affine light[3];  // baked, of blocks where it fits
} PlaneEquations;

// The first of these of LANES triangles, in the same order.
typedef struct {
    WideAffine weights, numerator, denominator, slot[SLOTS];
    vf first[3];
} WidePlanes;

// Up to LANES triangles; those beyond `count` repeat one.
typedef struct { int count, of[LANES]; } TriangleRow;

// A number of each of the triangles, which have `pitch` numbers each.
inline vf read_lanes(global const float *from, const TriangleRow *triangles, int pitch)
{
    if (triangles->count == 1) return from[(long)triangles->of[0] * pitch];
    private float found[LANES];
    for (int k = 0; k < LANES; ++k) found[k] = from[(long)triangles->of[k] * pitch];
    return VLOAD(found);
}

// A slot as a function over the block, of the weights `e` of the corners.
inline WideAffine set_up_slot(const Scene *s, const TriangleRow *triangles, int slot,
                              const WideAffine *e)
{
    const int of_uv = TEXTURED && slot >= COORDINATES && slot < TINT;
    const int begin = slot < COORDINATES ? NORMAL : of_uv ? COORDINATES : TINT;
    global const float *from = s->attributes + 3 * (begin - FIRST_ATTRIBUTE) + slot - begin;
    vf at[3];
    for (int k = 0; k < 3; ++k)
        at[k] = read_lanes(from + k * (of_uv ? 2 : 3), triangles, ATTRIBUTES);
    for (int k = 2; k >= 0 && slot >= TINT; --k) at[k] -= at[0];
    WideAffine f;
    for (int k = 0; k < AFFINE_TERMS; ++k)
        f.of[k] = at[0] * e[0].of[k] + at[1] * e[1].of[k] + at[2] * e[2].of[k];
    return f;
}

// Unit vectors along a, whose squares may overflow or underflow; 0 along 0.
inline Vec directions_of(Vec a)
{
    const Vec size = absolute3(a);
    const vf most = max(max(size.x, max(size.y, size.z)), (vf)(LEAST_LENGTH));
    a = (Vec){a.x / most, a.y / most, a.z / most};
    const vf length = max(sqrt(a.x * a.x + a.y * a.y + a.z * a.z), (vf)(LEAST_LENGTH));
    return (Vec){a.x / length, a.y / length, a.z / length};
}

inline void set_up_lanes(const Scene *s, const Bundle *r, const TriangleRow *triangles,
                         WidePlanes *out)
{
    Vec at[3], v[3];
    WideAffine e[3];
    global const float *from = s->corners;
    for (int k = 0; k < 3; ++k, from += 3)
        v[k] = at[k] = (Vec){read_lanes(from, triangles, 9), read_lanes(from + 1, triangles, 9),
                             read_lanes(from + 2, triangles, 9)};
    shear_corners(r, v);
    out->weights = edge_functions(r, v, e);
    // The sum of the weights is negative when the corners turn towards the viewer.
    const vi flip = LT(out->weights.of[ONE], (vf)(0.0f)) & (vi)(0x80000000);
    depth_functions(r, v, flip, &out->numerator, &out->denominator);
    if (!SMOOTH) {
        Vec n = directions_of(cross3(minus3(at[1], at[0]), minus3(at[2], at[0])));
        n = turn_vectors(n, ~flip & (vi)(0x80000000));
        const vf of[3] = {n.x, n.y, n.z};
        for (int k = 0; k < 3; ++k) out->slot[NORMAL + k] = (WideAffine){{of[k]}};
    }
    for (int slot = FIRST_ATTRIBUTE; slot < PLACE; ++slot)
        out->slot[slot] = set_up_slot(s, triangles, slot, e);
    for (int slot = PLACE; slot < SLOTS; ++slot) out->slot[slot] = e[slot - PLACE + 1];
    for (int k = 0; k < 3 && VERTEX_COLOURS; ++k)
        out->first[k] = read_lanes(s->attributes + 3 * (TINT - FIRST_ATTRIBUTE) + k, triangles,
                                   ATTRIBUTES);
}

inline void set_up_planes(const Scene *s, const Bundle *r, const TriangleRow *triangles,
                          global PlaneEquations *out)
{
    WidePlanes wide;
    set_up_lanes(s, r, triangles, &wide);
    for (int lane = 0; lane < triangles->count; ++lane, ++out) {
        const float *from = (const float *)&wide + lane;
        global float *to = (global float *)out;
        for (int k = 0; k < sizeof(WidePlanes) / sizeof(vf); ++k) to[k] = from[k * LANES];
        out->key = s->material_ids[triangles->of[lane]] * MIP_LEVELS;
        if (BAKED) vstore3(vload3(triangles->of[lane], s->grids), 0, out->grid);
    }
}
