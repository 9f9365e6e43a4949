// A scene's surfaces and lights, and plane equations: the quantities that a triangle interpolates
// over a block, as quotients of affine functions.
#pragma once
#include "visibility.cl"

#define TEXTURED ((TEXTURES & TEXTURED_BIT) != 0)
// Materials of metal and roughness or of several textures: a bit of TEXTURES.
#define PHYSICAL ((TEXTURES & PHYSICAL_BIT) != 0)

typedef struct {
    global const float *corners;     // (T, 9)
    global const float *attributes;  // (T, ATTRIBUTES) see texture.cl
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

// The slots of the interpolated quantities.  Flat triangles have one normal, towards the viewer;
// colours are differences from the first corner's, so that equal corners give exactly theirs.
enum {
    NORMAL = 0,
    COORDINATES = 3,
    TINT = COORDINATES + 2 * TEXTURED,
    WEIGHT = TINT + 3 * VERTEX_COLOURS,  // barycentric, of the second and the third corner
    SLOTS = WEIGHT + 2 * BAKED,
    FIRST_ATTRIBUTE = SMOOTH ? NORMAL : COORDINATES
};

typedef struct {
    Affine weights;                 // sum of the barycentric weights: twice n . D
    Affine numerator, denominator;  // depth is their quotient
    Affine slot[SLOTS];             // times the weights
    float first[3];                 // colour of the first corner
    int key;                        // shading key
    float tangent[PHYSICAL ? 4 : 1];  // direction of u, sign of v's beside it for a viewer
    int grid[3];  // of baked light: first point in front and behind, and cells along an edge
} PlaneEquations;

// The quantities of a hit: the slots, with baked light in place of WEIGHT, and the tangent with its
// sign.
enum { BAKED_LIGHT = WEIGHT, TANGENT = SLOTS + BAKED, QUANTITIES = TANGENT + 4 * PHYSICAL };

// A row of rays that hit one triangle.
typedef struct {
    vf depth, value[QUANTITIES];
    vi key, triangle;
    vi first, side;  // of the grid of baked light
} SampleRow;

// The members of PlaneEquations up to `first`, in the same order, for LANES triangles.
typedef struct { WideAffine weights, numerator, denominator, slot[SLOTS]; vf first[3]; }
    WideEquations;

// Up to LANES triangles; lanes beyond `count` repeat a triangle.
typedef struct { int count, ids[LANES]; } TriangleRow;

// Read a number per triangle, from an array with `pitch` numbers per triangle.
inline vf read_lanes(global const float *from, const TriangleRow *triangles, int pitch)
{
    if (triangles->count == 1) return from[(long)triangles->ids[0] * pitch];
    private float values[LANES];
    for (int k = 0; k < LANES; ++k) values[k] = from[(long)triangles->ids[k] * pitch];
    return VLOAD(values);
}

// Unit vectors along a; 0 for 0.  The squares of a may overflow or underflow.
inline Vec directions_of(Vec a)
{
    const Vec size = absolute3(a);
    const vf most = max(max(size.x, max(size.y, size.z)), (vf)(LEAST_LENGTH));
    a = (Vec){a.x / most, a.y / most, a.z / most};
    const vf length = max(sqrt(a.x * a.x + a.y * a.y + a.z * a.z), (vf)(LEAST_LENGTH));
    return (Vec){a.x / length, a.y / length, a.z / length};
}

// Set up everything except attributes; `e` receives the corners' weights.
inline void set_up_lanes(const Scene *s, const Bundle *r, const TriangleRow *triangles,
                         WideAffine *e, WideEquations *out)
{
    Vec at[3], v[3];
    global const float *from = s->corners;
    for (int k = 0; k < 3; ++k, from += 3)
        v[k] = at[k] = (Vec){read_lanes(from, triangles, 9), read_lanes(from + 1, triangles, 9),
                             read_lanes(from + 2, triangles, 9)};
    shear_corners(r, v);
    out->weights = edge_functions(r, v, e);
    // The sum of the weights is negative when the corners turn towards the viewer.
    const vi flip = LT(out->weights.term[ONE], (vf)(0.0f)) & (vi)(0x80000000);
    depth_functions(r, v, flip, &out->numerator, &out->denominator);
    if (!SMOOTH) {
        Vec n = directions_of(cross3(minus3(at[1], at[0]), minus3(at[2], at[0])));
        n = turn_vectors(n, ~flip & (vi)(0x80000000));
        const vf component[3] = {n.x, n.y, n.z};
        for (int k = 0; k < 3; ++k) out->slot[NORMAL + k] = (WideAffine){{component[k]}};
    }
}
