// The surfaces of hits: their materials, textures and normal maps.
#pragma once
#include "hits.cl"

// A surface's material and one mip level of its textures (height 0: none; without PHYSICAL only the
// first).  A shading key names both, material * MIP_LEVELS + level.
typedef struct { MaterialRecord record; MipLevel maps[MAPS]; } Material;

// What the own light of surfaces lacks, because other rays bring it: factors of the diffuse
// reflection of lights, and of surroundings; masks of metals that reflect their surroundings, of
// surfaces without highlights of lights that mirrored rays meet, and of those whose rays, spread by
// roughness, meet no suns.
typedef struct { vf matt, scattered; vi glossy, dull, rough; } Lacking;

// The surfaces of a row of rays with one material, which are shaded together.
typedef struct {
    const Material *material;
    Vec albedo, point;
    Vec normal;                     // of unit length
    Vec to_viewer;                  // of unit length, only for specular materials
    Vec smooth_normal, emission;  // PHYSICAL: the normal without the normal map
    vf metallic, alpha2;            // PHYSICAL: the fourth power of roughness
    Vec light;                      // BAKED: irradiance by sky and surfaces, over pi
    vf roughness;                   // PHYSICAL
    Lacking lacking;
} Surface;

inline int is_metallic(const Material *m) { return m->record.metallic >= 0.0f; }
inline int is_glossy(const Material *m) { return any(vload3(0, m->record.specular) > 0.0f); }

inline Vec map_row(const Scene *scene, const Material *m, int map, global const Hits *hits,
                   int at)
{
    const vf u = VLOAD(hits->value[COORDINATES] + at);
    const vf v = VLOAD(hits->value[COORDINATES + 1] + at);
    return sample_texture(scene->texels, m->maps[map], u, v);
}

// Turn the normals by their map, whose colours are (x, y, z) / 2 + 1 / 2 along tangent, v and
// normal.
inline Vec map_normals(const Scene *scene, const Material *m, global const Hits *hits,
                        int at, Vec n)
{
    const Vec c = map_row(scene, m, MAP_NORMAL, hits, at);
    const Vec along = load3(hits->value[TANGENT], at);
    const vf handedness = VLOAD(hits->value[TANGENT + 3] + at);
    Vec t = fma3(-dot3(along, n), n, along);
    const vf square = dot3(t, t);
    t = scale3(t, inverse_sqrt(max(square, (vf)(LEAST_LENGTH))));
    const Vec b = scale3(cross3(n, t), handedness);
    const Vec d = fma3((vf)(2.0f), c, spread3((float3)(-1.0f)));
    const float scale = m->record.normal_scale;
    Vec turned = fma3(d.x * scale, t, fma3(d.y * scale, b, scale3(n, d.z)));
    turned = scale3(turned, inverse_sqrt(max(dot3(turned, turned), (vf)(LEAST_LENGTH))));
    // Without texture coordinates there is no tangent, and normals stay.
    return pick3(n, turned, GT(square, (vf)(NOTHING_LEFT)));
}

// Read the material's other textures for a row of rays.
inline void read_row_maps(const Scene *scene, global const Hits *hits, int at, Surface *s)
{
    const Material *m = s->material;
    vf roughness = m->record.roughness;
    s->emission = spread3(vload3(0, m->record.emission));
    s->metallic = m->record.metallic;
    s->normal = s->smooth_normal = load3(hits->value[NORMAL], at);
    if (m->maps[MAP_NORMAL].height)
        s->normal = map_normals(scene, m, hits, at, s->smooth_normal);
    if (m->maps[MAP_METAL].height) {
        const Vec c = map_row(scene, m, MAP_METAL, hits, at);
        s->metallic = c.z * m->record.metallic;
        roughness = c.y * m->record.roughness;
    }
    if (m->maps[MAP_EMISSION].height)
        s->emission = times3(s->emission, map_row(scene, m, MAP_EMISSION, hits, at));
    s->roughness = roughness;
    const vf alpha = max(roughness, (vf)(LEAST_ROUGHNESS)) * max(roughness, (vf)(LEAST_ROUGHNESS));
    s->alpha2 = alpha * alpha;
}

// The material's colour times the texture's and the corners'.
inline Vec albedo_row(const Scene *scene, const Material *m, global const Hits *hits, int at)
{
    Vec c = spread3(vload3(0, m->record.diffuse));
    if (TEXTURED && m->maps[MAP_BASE].height)
        c = times3(c, map_row(scene, m, MAP_BASE, hits, at));
    if (VERTEX_COLOURS) c = times3(c, load3(hits->value[TINT], at));
    return c;
}
