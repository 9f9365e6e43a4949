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

// The colour of a light with shadows, number `k` of these, at a row of rays.
inline Vec tinted_colour(const Scene *scene, int k, global const int *lit, int at)
{
    const int number = scene->numbers->unshadowed_lights + k;
    const Vec colour = spread3(vload3(0, scene->lights[number].colour));
    return CLEAR ? times3(colour, load3(tints_of(scene, lit, k), at)) : colour;
}

// Add the reflection of a light on the rays `seeing` it.
inline void add_light(global const LightRecord *light, const Surface *s, vi seeing, Vec colour,
                      Vec *sum)
{
    vf attenuation;
    const Vec towards = towards_light(light, s->point, &attenuation);
    const vf cosine = dot3(s->normal, towards);
    vi facing = seeing & GT(cosine, (vf)(0.0f));
    if (PHYSICAL) facing &= GT(dot3(s->smooth_normal, towards), (vf)(0.0f));
    Vec c = scale3(s->albedo, pick((vf)(0.0f), cosine * attenuation, facing));
    if (PHYSICAL && is_metallic(s->material))
        c = reflect_light(s, towards, cosine, pick((vf)(0.0f), attenuation, facing));
    else if (is_glossy(s->material))
        c = fma3(highlight(s, towards, facing) * attenuation,
                 spread3(vload3(0, s->material->record.specular)), c);
    *sum = plus3(*sum, times3(c, colour));
}

inline Vec emission_of(const Surface *s)
{
    return PHYSICAL ? s->emission : spread3(vload3(0, s->material->record.emission));
}

// The reflected share of ambient light.
inline Vec ambient_share(const Surface *s)
{
    return PHYSICAL && is_metallic(s->material) ? ambient_reflectance(s) : s->albedo;
}

// Ambient or baked light, and emission.
inline Vec ambient_and_emission(const Scene *scene, const Surface *s)
{
    const Vec ambient = BAKED ? s->light : spread3(vload3(0, scene->numbers->ambient));
    if (SKY && BAKED && PHYSICAL && is_metallic(s->material))
        return plus3(reflect_sky(scene, s), emission_of(s));
    return plus3(times3(ambient_share(s), ambient), emission_of(s));
}

// The radiance of a row of rays of one material: lights without shadows, then lights with shadows.
inline Vec light_row(const Scene *scene, const Surface *s, global const int *lit, int at)
{
    const SceneArguments *n = scene->numbers;
    Vec sum = ambient_and_emission(scene, s);
    for (int k = 0; k < n->unshadowed_lights; ++k)
        add_light(scene->lights + k, s, (vi)(-1), spread3(vload3(0, scene->lights[k].colour)), &sum);
    for (int k = 0; SHADOWS && k < n->shadow_lights; ++k) {
        const int lit_bits = lit[k * BLOCK + at / BLOCK] >> at % BLOCK;
        if (lit_bits & ((1 << LANES) - 1))
            add_light(scene->lights + n->unshadowed_lights + k, s, mask_of_bits(lit_bits),
                      tinted_colour(scene, k, lit, at), &sum);
    }
    return sum;
}

// What becomes of hits: radiance; or emitted radiance, the share of ambient light that is
// reflected, and normals.
enum { RADIANCE, ALBEDO, SHADING_NORMAL, MOST_SHADED };
#if SINK == SURFACE || SINK == GIVEN_SURFACE
#define SHADED MOST_SHADED
inline void shade_row(const Scene *scene, const Surface *s, global const int *lit, int at,
                      Vec *values)
{
    values[RADIANCE] = emission_of(s);
    values[ALBEDO] = ambient_share(s);
    values[SHADING_NORMAL] = s->normal;
}
#else
#define SHADED 1
inline void shade_row(const Scene *scene, const Surface *s, global const int *lit, int at,
                      Vec *values)
{
    values[RADIANCE] = light_row(scene, s, lit, at);
}
#endif

// Write the rays in `mask` of a row to (SHADED, 3, BLOCK_RAYS).
inline void write_shaded(const Vec *values, vi mask, int at, global float *out)
{
    for (int k = 0; k < SHADED; ++k, out += 3 * BLOCK_RAYS)
        store3(pick3(load3(out, at), values[k], mask), out, at);
}

// The rays that hit nothing, in the rows that have some.
inline void shade_background(const Scene *scene, global const Hits *hits, global float *out)
{
    Vec values[SHADED] = {spread3(vload3(0, scene->numbers->background))};
    for (int k = 1; k < SHADED; ++k) values[k] = spread3(0.0f);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi missed = LT(VLOAD(hits->key + at), (vi)(0));
        if (!row_any(missed)) continue;
        if (SKY) values[RADIANCE] = sky_row(scene, load3(hits->direction, at), row_bits(missed));
        write_shaded(values, (vi)(-1), at, out);
    }
}

// Read the surfaces of a row.
inline void read_surface(const Scene *scene, global const Hits *hits, int at, Surface *s)
{
    s->point = load3(hits->point, at);
    s->normal = load3(hits->value[NORMAL], at);
    if (PHYSICAL || is_glossy(s->material)) {
        const Vec d = load3(hits->direction, at);
        s->to_viewer = scale3(d, -inverse_sqrt(dot3(d, d)));
    }
    if (BAKED) s->light = load3(hits->value[BAKED_LIGHT], at);
    s->albedo = albedo_row(scene, s->material, hits, at);
    if (PHYSICAL) read_row_maps(scene, hits, at, s);
    if (PHYSICAL && BAKED && SKY && s->material->maps[MAP_NORMAL].height) map_light(scene, s);
}

#if SPECULAR
inline Vec first_light(const Scene *scene, const AlphaTests *tests, global const Hits *hits,
                       global const int *lit, int at, vi mine, Surface *s);
#endif

// The rays that hit surfaces of one shading key.  `lit` has, for each light with shadows, a bit per
// ray that sees it.
inline void shade_key(const Scene *scene, const AlphaTests *tests, global const Hits *hits,
                      global const int *lit, int key, global float *out)
{
    global const MaterialRecord *record = scene->materials + key / MIP_LEVELS;
    Material material = {*record};
    if (TEXTURED) read_maps(scene, record, key % MIP_LEVELS, material.maps);
    Surface s;
    s.material = &material;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi mine = EQ(VLOAD(hits->key + at), (vi)(key));
        if (!row_any(mine)) continue;
        read_surface(scene, hits, at, &s);
        Vec values[SHADED];
#if SPECULAR
        if (record->sends_on)
            values[RADIANCE] = first_light(scene, tests, hits, lit, at, mine, &s);
        else
#endif
            shade_row(scene, &s, lit, at, values);
        write_shaded(values, mine, at, out);
    }
}

// Shade hits: (SHADED, 3, BLOCK_RAYS), linear, not clamped.
inline void shade_hits(const Scene *scene, const AlphaTests *tests, global const Hits *hits,
                       global const int *lit, global float *out)
{
    shade_background(scene, hits, out);
    for (int k = 0; k < hits->key_count; ++k) shade_key(scene, tests, hits, lit, hits->keys[k], out);
}
