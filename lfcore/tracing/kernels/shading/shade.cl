// Colours of a block's rays, row by row: ambient light, emission, and the visible lights.
#pragma once
#include "sky_gloss.cl"

// The unit vector to a light, zero at the light itself.  `attenuation` receives the factor of
// distance, cosine at the emitter and a spot's cone.
inline Vec towards_light(global const LightRecord *light, Vec point, vf *attenuation)
{
    *attenuation = 1.0f;
    const Vec vector = spread3(vload3(0, light->vector));
    if (!light->is_point) return vector;
    Vec l = minus3(vector, point);
    const vf inverse = inverse_sqrt(max(dot3(l, l), (vf)(NOTHING_LEFT)));
    l = scale3(l, inverse);
    const float reference = light->reference_distance;
    if (reference > 0.0f)
        *attenuation = min(reference * inverse * (reference * inverse), (vf)(MOST_ATTENUATION));
    const float3 n = vload3(0, light->normal);
    if (any(n != 0.0f)) {
        vf cosine = max(-dot3(l, spread3(n)), (vf)(0.0f));
        const float2 cone = vload2(0, light->cone);
        if (cone.x > 0.0f) {
            cosine = clamp(fma(cosine, (vf)(cone.x), (vf)(cone.y)), (vf)(0.0f), (vf)(1.0f));
            cosine *= cosine;
        }
        *attenuation *= cosine;
    }
    return l;
}

inline int is_glossy(const Material *m) { return any(vload3(0, m->record.specular) > 0.0f); }

// Add the reflection of a light on the rays `seeing` it.
inline void add_light(global const LightRecord *light, const Surface *s, vi seeing, Vec *sum)
{
    vf attenuation;
    const Vec towards = towards_light(light, s->point, &attenuation);
    const vf cosine = dot3(s->normal, towards);
    vi facing = seeing & GT(cosine, (vf)(0.0f));
    if (PHYSICAL) facing &= GT(dot3(s->geometric_normal, towards), (vf)(0.0f));
    Vec c = scale3(s->albedo, pick((vf)(0.0f), cosine * attenuation, facing));
    if (PHYSICAL && is_metallic(s->material))
        c = reflect_light(s, towards, cosine, pick((vf)(0.0f), attenuation, facing));
    else if (is_glossy(s->material))
        c = fma3(highlight(s, towards, facing) * attenuation,
                 spread3(vload3(0, s->material->record.specular)), c);
    *sum = plus3(*sum, times3(c, spread3(vload3(0, light->colour))));
}

// Ambient or baked light, and emission.
inline Vec ambient_and_emission(const Scene *scene, const Surface *s)
{
    const Vec ambient = BAKED ? s->light : spread3(vload3(0, scene->numbers->ambient));
    const Vec emission = PHYSICAL ? s->emission : spread3(vload3(0, s->material->record.emission));
    const int metallic = PHYSICAL && is_metallic(s->material);
    if (SKY && metallic) return plus3(reflect_sky(scene, s), emission);
    return plus3(times3(metallic ? ambient_reflectance(s) : s->albedo, ambient), emission);
}

// The material's colour times the texture's and the corners'.
inline Vec albedo_row(const Scene *scene, const Material *m, global const Samples *samples, int at)
{
    Vec c = spread3(vload3(0, m->record.diffuse));
    if (TEXTURED && m->maps[MAP_BASE].height)
        c = times3(c, map_row(scene, m, MAP_BASE, samples, at));
    if (VERTEX_COLOURS) c = times3(c, load3(samples->value[TINT], at));
    return c;
}

// The radiance of a row of rays of one material: lights without shadows, then lights with shadows.
inline Vec light_row(const Scene *scene, const Block *b, const Surface *s, int at)
{
    const SceneArguments *n = scene->numbers;
    Vec sum = ambient_and_emission(scene, s);
    for (int k = 0; k < n->unshadowed_lights; ++k)
        add_light(scene->lights + k, s, (vi)(-1), &sum);
    for (int k = 0; SHADOWS && k < n->shadow_lights; ++k) {
        const int lit = b->lit[k * BLOCK + at / BLOCK] >> at % BLOCK;
        if (lit & ((1 << LANES) - 1))
            add_light(scene->lights + n->unshadowed_lights + k, s, mask_of_bits(lit), &sum);
    }
    return sum;
}

// The colours of rows with rays that hit nothing.
inline void shade_background(const Scene *scene, const Block *b, global float *colours)
{
    Vec background = spread3(vload3(0, scene->numbers->background));
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        if (!row_any(LT(VLOAD(b->samples->key + at), (vi)(0)))) continue;
        if (SKY) background = sky_row(scene, &b->bundle, row_at(at, b->bundle.half_extent));
        store3(background, colours, at);
    }
}

// List the distinct shading keys of a block; returns their number.
inline int list_keys(const Block *b, private int *keys)
{
    int count = 0;
    for (int k = 0; k < b->regions.count; ++k) {
        const int key = b->equations[k].key;
        int at = 0;
        while (at < count && keys[at] != key) ++at;
        if (at == count) keys[count++] = key;
    }
    return count;
}

inline void shade_key(const Scene *scene, const Block *b, int key, global float *colours)
{
    global const MaterialRecord *record = scene->materials + key / MIP_LEVELS;
    Material material = {*record};
    if (TEXTURED) read_maps(scene, record, key % MIP_LEVELS, material.maps);
    Surface s;
    s.material = &material;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi mine = EQ(VLOAD(b->samples->key + at), (vi)(key));
        if (!row_any(mine)) continue;
        s.point = load3(b->samples->point, at);
        s.normal = load3(b->samples->value[NORMAL], at);
        if (PHYSICAL || is_glossy(&material)) {
            const Vec d = direction_row(&b->bundle, row_at(at, b->bundle.half_extent));
            s.to_viewer = scale3(d, -inverse_sqrt(dot3(d, d)));
        }
        if (BAKED) s.light = load3(b->samples->value[BAKED_LIGHT], at);
        s.albedo = albedo_row(scene, &material, b->samples, at);
        if (PHYSICAL) read_row_maps(scene, b->samples, at, &s);
        if (PHYSICAL && BAKED && SKY && material.maps[MAP_NORMAL].height) map_light(scene, &s);
        store3(pick3(load3(colours, at), light_row(scene, b, &s, at), mine), colours, at);
    }
}
