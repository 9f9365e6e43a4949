// A scene's surfaces and lights, and the quantities that triangles interpolate between corners.
#pragma once
#include "numerics.cl"
#include "one_ray.cl"

#define TEXTURED ((TEXTURES & TEXTURED_BIT) != 0)
// Materials of metal and roughness or of several textures: a bit of TEXTURES.
#define PHYSICAL ((TEXTURES & PHYSICAL_BIT) != 0)
// The numbers per triangle: corners' normals, texture coordinates and colours, if a scene has them.
#define ATTRIBUTES (9 * SMOOTH + 6 * TEXTURED + 9 * VERTEX_COLOURS)

typedef struct {
    global const float *corners;     // (T, 9)
    global const float *attributes;  // (T, ATTRIBUTES)
    global const int *material_ids;  // (T,)
    global const MaterialRecord *materials;
    global const LightRecord *lights;
    global const MipLevel *mip_levels;  // (textures, MIP_LEVELS)
    global const uint *texels;
    global const int *grids;         // (T, 3) see baked.cl
    global const uint *baked_light;  // (P,) at the points of all grids
    global const float *sky;         // (side, side, 4), and the maps of sky_gloss.cl
    const SceneArguments *numbers;
} Scene;

// A worker's bits of rays that see each light, (shadow lights, BLOCK), are followed by tints of the
// lights, (shadow lights, 3, BLOCK_RAYS), if a scene is CLEAR: it has surfaces that light passes.
inline global float *tints_of(const Scene *s, global const int *lit, int light)
{
    return (global float *)(lit + s->numbers->shadow_lights * BLOCK) + light * 3 * BLOCK_RAYS;
}

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

inline float3 corner(const Scene *s, int triangle, int k)
{
    return vload3(k, s->corners + triangle * 9);
}
// The geometric normal of a triangle, twice its area long.
inline float3 geometric_normal(const Scene *s, int triangle)
{
    const float3 p = corner(s, triangle, 0);
    return cross_product(corner(s, triangle, 1) - p, corner(s, triangle, 2) - p);
}
inline global const float *attributes_of(const Scene *s, int triangle)
{
    return s->attributes + (long)triangle * ATTRIBUTES;
}

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

inline void read_corners(const Scene *s, const TriangleRow *triangles, Vec *v)
{
    global const float *from = s->corners;
    for (int k = 0; k < 3; ++k, from += 3)
        v[k] = (Vec){read_lanes(from, triangles, 9), read_lanes(from + 1, triangles, 9),
                     read_lanes(from + 2, triangles, 9)};
}

// The corners' values of a slot of attributes.
inline void read_slot(const Scene *s, const TriangleRow *triangles, int slot, vf *at)
{
    const int of_uv = TEXTURED && slot >= COORDINATES && slot < TINT;
    const int begin = slot < COORDINATES ? NORMAL : of_uv ? COORDINATES : TINT;
    global const float *from = s->attributes + 3 * (begin - FIRST_ATTRIBUTE) + slot - begin;
    for (int k = 0; k < 3; ++k)
        at[k] = read_lanes(from + k * (of_uv ? 2 : 3), triangles, ATTRIBUTES);
    for (int k = 2; k >= 0 && slot >= TINT; --k) at[k] -= at[0];
}

// The first corners' colours.
inline void read_first(const Scene *s, const TriangleRow *triangles, vf *first)
{
    for (int k = 0; k < 3 && VERTEX_COLOURS; ++k)
        first[k] = read_lanes(s->attributes + 3 * (TINT - FIRST_ATTRIBUTE) + k, triangles,
                              ATTRIBUTES);
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

// Bilinear interpolation of a map (side, side, 4).
inline float4 map_between(global const float *map, int side, float x, float y)
{
    const int i = clamp((int)x, 0, side - 2), j = clamp((int)y, 0, side - 2);
    const float f = x - i, g = y - j;
    global const float *texel = map + 4 * (j * side + i), *below = texel + 4 * side;
    const float4 top = vload4(0, texel) + f * (vload4(1, texel) - vload4(0, texel));
    const float4 end = vload4(0, below) + f * (vload4(1, below) - vload4(0, below));
    return top + g * (end - top);
}
