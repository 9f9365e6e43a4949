// Tints: the share of a light that reaches hit points through glass, panes and veils, straight.
//
// At each surface, light passes in the share a (1 - K) (1 - metal) transmission base (1 - F) + 1 - a
// of events.cl.  Volumes absorb it between where it enters and where it leaves, in any order: the
// length is the sum of the distances where it leaves less those where it enters.
#pragma once
#include "fresnel.cl"
#include "powers.cl"
#include "shadow_rays.cl"
#include "single_rays.cl"
#include "texture.cl"

#define LOG2_E 1.44269504f

// Whether a ray may meet the box around all clear triangles before `far`.
inline int may_meet_clear(const Scene *s, const Ray *r, float far)
{
    float from = 0.0f, to = far;
    for (int k = 0; k < 3; ++k) {
        const float inverse = axis(r->path.inverse_lo, k), at = axis(r->origin, k);
        const float low = s->numbers->clear_low[k] - at, high = s->numbers->clear_high[k] - at;
        if (inverse == 0.0f) {
            if (low > 0.0f || high < 0.0f) return 0;
            continue;
        }
        from = max(from, min(low * inverse, high * inverse));
        to = min(to, max(low * inverse, high * inverse) * SWEEP_SLACK);
    }
    return from <= to;
}

inline float reflectance(float cosine, float eta)
{
    const vf row = dielectric((vf)(cosine), (vf)(eta));
    return ((const float *)&row)[0];
}

// The colour of a texture at barycentric weights of a triangle, at full resolution; 1 without.
inline float3 texture_at(const Scene *s, int id, int map, float3 w)
{
    const int texture = map_of(s->materials + s->material_ids[id], map);
    if (texture < 0) return 1.0f;
    global const float *uv = attributes_of(s, id) + 9 * SMOOTH;
    const float2 at = w.x * vload2(0, uv) + w.y * vload2(1, uv) + w.z * vload2(2, uv);
    const Vec colour = sample_texture(s->texels, level_of(s, texture, 0), (vf)(at.x), (vf)(at.y));
    return ray_vector(&colour, 0);
}

// The colour of a triangle's corners between them; 1 without.
inline float3 colour_between(const Scene *s, int id, float3 w)
{
    if (!VERTEX_COLOURS) return 1.0f;
    global const float *tints = attributes_of(s, id) + 9 * SMOOTH + 6 * TEXTURED;
    return w.x * vload3(0, tints) + w.y * vload3(1, tints) + w.z * vload3(2, tints);
}

// The share that passes a clear triangle at a point, given by its barycentric weights, too;
// `absorbed` receives what its volume absorbs, per distance.
inline float3 pass_triangle(const Shadows *s, int id, float3 point, float3 weights,
                            float3 direction, float3 *absorbed)
{
    const Scene *scene = s->scene;
    global const MaterialRecord *m = scene->materials + scene->material_ids[id];
    const float3 n = geometric_normal(scene, id);
    const float slant = inner_product(n, direction);
    const float size = sqrt(inner_product(n, n) * inner_product(direction, direction));
    const float cosine = fabs(slant) / max(size, LEAST_LENGTH);
    float opacity = m->opacity;
    const AlphaTests *tests = &s->tree->alpha_tests;
    if (m->alpha_blend && has_holes(tests, id)) {
        opacity *= alpha_of(tests, tests->records + tests->record_of[id], point) / 255.0f;
    }
    if (m->transmission == 0.0f) return 1.0f - opacity;
    float reflected = reflectance(cosine, 1.0f / m->ior);
    if (m->thin_walled) reflected = 2.0f * reflected / (1.0f + reflected);
    else *absorbed = (slant < 0.0f ? -1.0f : 1.0f) * vload3(0, m->absorption);
    const int coat = m->clearcoat > 0.0f && m->clearcoat_roughness <= TRACED_ROUGHNESS;
    const float shield = coat ? m->clearcoat * reflectance(cosine, 1.0f / COAT) : 0.0f;
    const float metal = max(m->metallic, 0.0f) *
                        (PHYSICAL ? texture_at(scene, id, MAP_METAL, weights).z : 1.0f);
    const float through = opacity * (1.0f - shield) * (1.0f - metal) * m->transmission *
                          (1.0f - reflected);
    const float3 base = vload3(0, m->diffuse) * texture_at(scene, id, MAP_BASE, weights) *
                        colour_between(scene, id, weights);
    return through * base + (1.0f - opacity);
}

// The tint of light on its way from a point until `far`.
inline float3 tint_of(const Shadows *s, const Ray *r, float far, int receiver, int2 light)
{
    float3 tint = 1.0f, absorbed = 0.0f;
    const Volume volume = {.sweep = &r->path, .sorted = 1};
    Stack stack;
    start_walk(&stack);
    for (int leaf; (leaf = next_leaf(s->tree, &volume, far, &stack)) >= 0;) {
        global const Leaf *triangles = s->tree->leaves + leaf;
        uint bits = may_hit(r, triangles, far * SWEEP_SLACK), clear = 0;
        for (int lane = 0; bits >> lane && lane < NODE_WIDTH; lane += LANES)
            clear |= shading_lanes(s, r, leaf, lane, receiver, light, 1);
        for (bits &= clear; bits; bits &= bits - 1) {
            const int at = lowest(bits), id = triangle_ids(s->tree, leaf, at)[0];
            float time;
            float3 weights, per_distance = 0.0f;
            if (!hits_triangle(r, triangles, at, &time, &weights) || time > far) continue;
            if (!crosses_triangle(r, triangles, at)) continue;
            tint *= pass_triangle(s, id, r->origin + time * r->direction, weights, r->direction,
                                  &per_distance);
            absorbed += time * per_distance;
        }
    }
    const float length = sqrt(inner_product(r->direction, r->direction));
    const float3 power = -LOG2_E * length * max(absorbed, 0.0f);
    const vf kept[3] = {exp2_fast((vf)(power.x)), exp2_fast((vf)(power.y)),
                        exp2_fast((vf)(power.z))};
    return tint * (float3)(((const float *)kept)[0], ((const float *)(kept + 1))[0],
                           ((const float *)(kept + 2))[0]);
}

// Find the tints (3, BLOCK_RAYS) of a light at the rays that see it.
inline void find_tints(const Shadows *s, global const Hits *hits, global const LightRecord *light,
                       global const int *lit, global float *tints)
{
    const int2 triangles = vload2(0, light->triangles);
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        float3 tint = 1.0f;
        if (lit[at / BLOCK] >> at % BLOCK & 1) {
            global const float *p = s->origins + at;
            const float3 from = (float3)(p[0], p[BLOCK_RAYS], p[2 * BLOCK_RAYS]);
            int exponent;
            const Ray ray = scaled_ray(
                from, vload3(0, light->vector) - (light->is_point ? from : 0.0f), &exponent);
            const float far = light->is_point ? ldexp(1.0f, exponent) : FAR;
            if (may_meet_clear(s->scene, &ray, far))
                tint = tint_of(s, &ray, far, hits->triangle[at], triangles);
        }
        tints[at] = tint.x;
        tints[BLOCK_RAYS + at] = tint.y;
        tints[2 * BLOCK_RAYS + at] = tint.z;
    }
}
