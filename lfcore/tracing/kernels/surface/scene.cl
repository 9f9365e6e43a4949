// The surfaces and lights of a scene, as the host packs them.
#ifndef LFCORE_SCENE_CL
#define LFCORE_SCENE_CL
#include "regions.cl"

// Attributes of a triangle's corners: normals, texture coordinates, colours, as far as a scene has
// them.
#define ATTRIBUTES (9 * SMOOTH + 6 * TEXTURED + 9 * VERTEX_COLOURS)
// Materials of metal and roughness or of several textures: a bit of TEXTURES.
#define PHYSICAL (TEXTURES >> 2 & 1)
#define MATERIAL 20
enum { MAP_BASE, MAP_NORMAL, MAP_METAL, MAP_GLOW, MAPS };  // a material's textures
#define LIGHT 16
#define LIGHT_NORMAL 8
#define LIGHT_OWN 12
#define MIP_LEVELS 12

typedef struct {
    float ambient[3], background[3];
    int open_lights, shadow_lights;  // lights without shadows come first
} SceneArguments;

typedef struct {
    global const float *corners;     // (T, 9)
    global const float *attributes;  // (T, ATTRIBUTES)
    global const int *material_ids;  // (T,)
    global const float *materials;   // (K, MATERIAL): see read_material
    global const float *lights;      // (lights, LIGHT): see the functions below
    // (textures, MIP_LEVELS): offset, width, height, number of levels.
    global const int4 *images;
    global const uint *texels;
    const SceneArguments *numbers;
} Scene;

#define SCENE_PARAMETERS                     \
    global const float *restrict corners,    \
    global const float *restrict attributes, \
    global const int *restrict material_ids, \
    global const float *restrict materials,  \
    global const float *restrict lights,     \
    global const int4 *restrict images,      \
    global const uint *restrict texels,      \
    const SceneArguments scene_numbers
#define MAKE_SCENE \
    {corners, attributes, material_ids, materials, lights, images, texels, &scene_numbers}

inline float3 corner(const Scene *s, int triangle, int k)
{
    return vload3(k, s->corners + triangle * 9);
}
inline global const float *attributes_of(const Scene *s, int triangle)
{
    return s->attributes + (long)triangle * ATTRIBUTES;
}

// A light's place or, where it is directional, the direction towards it.
inline float3 light_vector(global const float *light) { return vload3(0, light); }
inline int is_point(global const float *light) { return light[3] != 0.0f; }
inline float3 light_colour(global const float *light) { return vload3(0, light + 4); }
// At this distance a light that falls off has its colour; 0 if it does not.
inline float reference_distance(global const float *light) { return light[7]; }
// Of a point of an emitter the normal there, of a spot its axis; else 0.
inline float3 emitter_normal(global const float *light) { return vload3(0, light + LIGHT_NORMAL); }

// Of a spot the line of the cosine to its axis whose square is its strength; 0 of what is none.
inline float2 light_cone(global const float *light) { return (float2)(light[11], light[14]); }

// Triangles that never shadow a light, those of the emitter that it is a point of: the first, and
// that after the last.
inline int2 own_triangles(global const float *light)
{
    return as_int2(vload2(0, light + LIGHT_OWN));
}
inline vi are_own(int2 own, global const int *ids)
{
    return GE(VLOAD(ids), (vi)(own.x)) & LT(VLOAD(ids), (vi)(own.y));
}

// What a surface is made of: a material and one mip level of its texture, which a shading key says,
// material * MIP_LEVELS + level.
typedef struct {
    float3 diffuse, specular, emission;
    float shininess, dull;  // no highlight where its cosine is below `dull`
    int4 image;             // height 0 without a texture
    // Of PHYSICAL scenes: metal from 0 to 1, less than 0 for Blinn-Phong; how much the normal map
    // bends; the other textures, each as `image`.
    float metallic, roughness, bend;
    int4 maps[MAPS];
} Material;

// One of a material's textures, -1 without it.
inline int map_of(global const float *material, int map)
{
    return TEXTURED ? as_int(material[map == MAP_BASE ? 7 : 14 + map]) : -1;
}
inline int4 image_of(const Scene *s, int texture, int level)
{
    return texture < 0 ? (int4)(0) : s->images[texture * MIP_LEVELS + level];
}

// The texture whose texels choose the mip level, and -1 without any.
inline int leading_map(global const float *material)
{
    int texture = map_of(material, MAP_BASE);
    for (int map = 1; PHYSICAL && map < MAPS && texture < 0; ++map) texture = map_of(material, map);
    return texture;
}

// The other textures at about the leading one's texels: halvings that it has more are left out.
inline void read_maps(const Scene *s, global const float *material, int level, Material *m)
{
    m->metallic = material[12];
    m->roughness = material[13];
    m->bend = material[14];
    const int levels = image_of(s, leading_map(material), 0).w;
    for (int map = 1; map < MAPS; ++map) {
        const int texture = map_of(material, map), own = image_of(s, texture, 0).w;
        m->maps[map] = image_of(s, texture, clamp(level - levels + own, 0, max(own - 1, 0)));
    }
}

inline Material read_material(const Scene *s, int key)
{
    global const float *material = s->materials + key / MIP_LEVELS * MATERIAL;
    Material m;
    m.diffuse = vload3(0, material);
    m.shininess = material[3];
    m.specular = vload3(0, material + 4);
    m.emission = vload3(0, material + 8);
    m.dull = material[11];
    m.image = image_of(s, map_of(material, MAP_BASE), key % MIP_LEVELS);
    if (PHYSICAL) read_maps(s, material, key % MIP_LEVELS, &m);
    return m;
}

#endif
