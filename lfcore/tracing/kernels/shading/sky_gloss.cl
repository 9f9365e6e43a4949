// The sky, and its reflection by metallic-roughness materials: see lfcore/scene/sky_gloss.py.
#pragma once
#include "gloss.cl"

// The sky's radiance along the rays in `bits` of a row.  Its map is octahedral: a forward direction
// d in camera space is at d.xy / (|d.x| + |d.y| + |d.z|); the others are folded outwards.
inline Vec sky_row(const Scene *s, Vec d, uint bits)
{
    const int side = s->numbers->sky_side;
    Vec light = spread3(0.0f);
    for (uint left = bits; left; left &= left - 1) {
        const uint k = lowest(left);
        const float3 along = ray_vector(&d, k);
        const float sum = fabs(along.x) + fabs(along.y) + fabs(along.z);
        const float2 folded = copysign(sum - fabs(along.yx), along.xy);
        const float2 at = fma(along.z < 0.0f ? folded : along.xy, 0.5f * side / sum,
                              0.5f * side - 0.5f);
        const float2 inside = clamp(at, 0.0f, side - 1.0f);
        set_ray_vector(&light, k, map_between(s->sky, side, inside.x, inside.y).xyz);
    }
    return light;
}

// A map of the sky's gloss in a direction.
inline float4 gloss_between(global const float *gloss, int map, float3 d)
{
    d /= max(fabs(d.x) + fabs(d.y) + fabs(d.z), LEAST_LENGTH);  // the sum of opposite normals is 0
    const float2 folded = {copysign(1.0f - fabs(d.y), d.x), copysign(1.0f - fabs(d.x), d.y)};
    const float2 at = ((d.z < 0.0f ? folded : d.xy) + 1.0f) * (0.5f * (GLOSS_SIDE - 1));
    return map_between(gloss + 4 * map * GLOSS_SIDE * GLOSS_SIDE, GLOSS_SIDE, at.x, at.y);
}

// The sky's mean over the lobe about a mirrored direction.
inline float4 lobe_of(global const float *gloss, float3 mirrored, float roughness)
{
    const float level = roughness * (GLOSS_LEVELS - 1);
    const int k = clamp((int)level, 0, GLOSS_LEVELS - 2);
    const float4 sharp = gloss_between(gloss, k, mirrored);
    return sharp + (level - k) * (gloss_between(gloss, k + 1, mirrored) - sharp);
}

// Let the rays in `bits` that spread read the sky as wide as that, without its suns.  The lobe of a
// roughness r covers the solid angle 4 pi r^4.
inline void blur_sky(const Scene *s, Vec d, vf spread, uint bits, Vec *light)
{
    const int side = s->numbers->sky_side;
    for (uint left = bits; left; left &= left - 1) {
        const uint k = lowest(left);
        const float wide = ((const float *)&spread)[k];
        if (!(wide > 0.0f)) continue;
        const float roughness = min(sqrt(wide * 0.28209479f), 1.0f);
        const float4 blurred = lobe_of(s->sky + 4 * side * side, ray_vector(&d, k), roughness);
        set_ray_vector(light, k, blurred.xyz);
    }
}

// The least irradiance of the open sky that others are divided by.
#define LEAST_SKY 1e-20f
// The largest factor of a normal map on baked light: seams of normals must not look like emitters.
#define MOST_BRIGHTENED 4.0f

// Scale a row's baked light, which ignores the normal map, by the ratio of the open sky's
// irradiance at the mapped normal to that at the geometric normal.
inline void map_light(const Scene *scene, Surface *s)
{
    const int side = scene->numbers->sky_side;
    global const float *gloss = scene->sky + 4 * side * side;
    for (int k = 0; k < LANES; ++k) {
        const float3 n = ray_vector(&s->smooth_normal, k);
        const float3 unmapped = gloss_between(gloss, GLOSS_LEVELS, n).xyz;
        const float3 mapped = gloss_between(gloss, GLOSS_LEVELS, ray_vector(&s->normal, k)).xyz;
        const float3 share = min(mapped / max(unmapped, LEAST_SKY), MOST_BRIGHTENED);
        set_ray_vector(&s->light, k, ray_vector(&s->light, k) * share);
    }
}

// Reflected baked light, and the reflected sky as far as it is not occluded.
inline Vec reflect_sky(const Scene *scene, const Surface *s)
{
    const int side = scene->numbers->sky_side;
    global const float *gloss = scene->sky + 4 * side * side;
    global const float *shares = gloss + 4 * (GLOSS_LEVELS + 1) * GLOSS_SIDE * GLOSS_SIDE;
    const vf cosine = clamp(dot3(s->normal, s->to_viewer), (vf)(0.0f), (vf)(1.0f));
    const Vec mirrored = fma3(2.0f * cosine, s->normal, scale3(s->to_viewer, (vf)(-1.0f)));
    private float cosines[LANES], rough[LANES], share[2][LANES];
    Vec sky;
    VSTORE(cosine, cosines);
    VSTORE(min(sqrt(sqrt(s->alpha2)), (vf)(1.0f)), rough);
    for (int k = 0; k < LANES; ++k) {
        const float3 whole = gloss_between(gloss, GLOSS_LEVELS, ray_vector(&s->normal, k)).xyz;
        const float3 unhidden = clamp(ray_vector(&s->light, k) / max(whole, LEAST_SKY), 0.0f, 1.0f);
        const float4 ab = map_between(shares, GLOSS_SHARES, cosines[k] * (GLOSS_SHARES - 1),
                                      rough[k] * (GLOSS_SHARES - 1));
        set_ray_vector(&sky, k, lobe_of(gloss, ray_vector(&mirrored, k), rough[k]).xyz * unhidden);
        share[0][k] = ab.x;
        share[1][k] = ab.y;
    }
    const vf a = VLOAD(share[0]), b = VLOAD(share[1]), rest = 1.0f - s->metallic;
    const Vec gloss_share = {fma(a, f0(s, s->albedo.x), b), fma(a, f0(s, s->albedo.y), b),
                             fma(a, f0(s, s->albedo.z), b)};
    const Vec diffuse = scale3(times3(s->albedo, minus3(spread3(1.0f), gloss_share)), rest);
    return plus3(times3(diffuse, s->light), times3(gloss_share, sky));
}
