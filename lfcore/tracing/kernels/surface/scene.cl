// The surfaces and lights of a scene, as the host packs them.
#pragma once
#include "regions.cl"

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
    global const int *grids;         // (T, 3) see light.cl
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

// Mask of a light's triangles, which never shadow it: `own` are the first, and one past the last.
inline vi are_of_light(int2 own, global const int *ids)
{
    return GE(VLOAD(ids), (vi)(own.x)) & LT(VLOAD(ids), (vi)(own.y));
}

// A surface's material and one mip level of its texture.  A shading key names both, material *
// MIP_LEVELS + level.
typedef struct {
    float3 diffuse, specular, emission;
    float shininess, specular_cutoff;
    Level maps[MAPS];  // height 0: no texture; without PHYSICAL the first alone
    // Scenes with PHYSICAL alone.
    float metallic, roughness, normal_scale;
} Material;

// A row of rays' surfaces, of one material, which is shaded together.
typedef struct {
    const Material *material;
    Vec albedo, point;
    Vec normal;     // of unit length
    Vec to_viewer;  // direction to the viewer, of unit length; only specular materials have it
    // Scenes with PHYSICAL alone.
    Vec geometric;  // the normal before the normal map
    vf metallic;
    vf alpha2;      // the fourth power of roughness
    Vec emission;
    // Scenes with BAKED alone.
    Vec light;      // that arrives from sky and surfaces
} Surface;
