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
    const SceneArguments *numbers;
} Scene;

// Of a kernel's parameters.
#define MAKE_SCENE                                                                             \
    {.corners = corners, .attributes = attributes, .material_ids = material_ids,               \
     .materials = materials, .lights = lights, .levels = levels, .texels = texels,             \
     .numbers = &scene_numbers}

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
    Level base;  // height 0: no texture
    // Scenes with PHYSICAL alone.
    float metallic, roughness, normal_scale;
    Level maps[MAPS];
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
} Surface;

// One of a material's textures, -1 without it.
inline int map_of(global const MaterialRecord *material, int map)
{
    return TEXTURED ? material->maps[map] : -1;
}
inline Level level_of(const Scene *s, int texture, int level)
{
    return texture < 0 ? (Level){0, 0, 0, 0} : s->levels[texture * MIP_LEVELS + level];
}

// The texture whose texels choose the mip level; -1 without textures.
inline int leading_map(global const MaterialRecord *material)
{
    int texture = map_of(material, MAP_BASE);
    for (int map = 1; PHYSICAL && map < MAPS && texture < 0; ++map) texture = map_of(material, map);
    return texture;
}

// The other textures, at levels whose texels are about as large as the leading one's.
inline void read_maps(const Scene *s, global const MaterialRecord *material, int level, Material *m)
{
    m->metallic = material->metallic;
    m->roughness = material->roughness;
    m->normal_scale = material->normal_scale;
    const int levels = level_of(s, leading_map(material), 0).levels;
    for (int map = 1; map < MAPS; ++map) {
        const int texture = map_of(material, map), count = level_of(s, texture, 0).levels;
        m->maps[map] = level_of(s, texture, clamp(level - levels + count, 0, max(count - 1, 0)));
    }
}

inline Material read_material(const Scene *s, int key)
{
    global const MaterialRecord *material = s->materials + key / MIP_LEVELS;
    Material m;
    m.diffuse = vload3(0, material->diffuse);
    m.shininess = material->shininess;
    m.specular = vload3(0, material->specular);
    m.emission = vload3(0, material->emission);
    m.specular_cutoff = material->specular_cutoff;
    m.base = level_of(s, map_of(material, MAP_BASE), key % MIP_LEVELS);
    if (PHYSICAL) read_maps(s, material, key % MIP_LEVELS, &m);
    return m;
}
