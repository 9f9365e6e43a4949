// Light that a surface sends back to the lens: ambient, emission, and what it reflects of each
// light, by Blinn-Phong unless its material is of metal and roughness.
//
// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH
// 1977.
#ifndef LFCORE_LIGHTS_CL
#define LFCORE_LIGHTS_CL
#include "microfacet.cl"

// The direction of unit length to a light.  `attenuation` receives the share of the light that
// distance, the cosine at the emitter and a spot's cone leave.
inline Vec towards_light(global const LightRecord *light, Vec point, vf *attenuation)
{
    *attenuation = 1.0f;
    const Vec vector = spread3(vload3(0, light->vector));
    if (!light->is_point) return vector;
    Vec l = minus3(vector, point);
    const vf inverse = inverse_sqrt(dot3(l, l));
    l = scale3(l, inverse);
    const float reference = light->reference_distance;
    if (reference > 0.0f) *attenuation = reference * inverse * (reference * inverse);
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

inline int is_glossy(const Material *m)
{
    return m->specular.x + m->specular.y + m->specular.z > 0.0f;
}

// A highlight: a power of the cosine between the normal and halfway to the viewer.
inline vf highlight(const Surface *s, Vec towards, vi facing)
{
    const Vec h = plus3(towards, s->view);
    const vf halfway = dot3(s->normal, h) * inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT)));
    const vi glossy = facing & GE(halfway, (vf)(s->material->specular_cutoff));
    if (!row_any(glossy)) return 0.0f;
    const vf cosine = max(halfway, (vf)(NOTHING_LEFT));
    const vf power = exp2_fast(s->material->shininess * log2_fast(cosine));
    return pick((vf)(0.0f), power, glossy);
}

// The light that a Blinn-Phong surface reflects.
inline Vec reflect_blinn_phong(const Surface *s, Vec towards, vf cosine, vf attenuation, vi facing)
{
    const Vec diffuse = scale3(s->albedo, pick((vf)(0.0f), cosine * attenuation, facing));
    if (!is_glossy(s->material)) return diffuse;
    const vf specular = highlight(s, towards, facing) * attenuation;
    return fma3(specular, spread3(s->material->specular), diffuse);
}

// Add what one light gives the rays that see it.
inline void add_light(global const LightRecord *light, const Surface *s, vi seeing, Vec *sum)
{
    vf attenuation;
    const Vec towards = towards_light(light, s->point, &attenuation);
    const vf cosine = dot3(s->normal, towards);
    vi facing = seeing & GT(cosine, (vf)(0.0f));
    if (PHYSICAL) facing &= GT(dot3(s->geometric, towards), (vf)(0.0f));
    Vec c;
    if (PHYSICAL && is_metallic(s->material))
        c = reflect_light(s, towards, cosine, pick((vf)(0.0f), attenuation, facing));
    else c = reflect_blinn_phong(s, towards, cosine, attenuation, facing);
    *sum = plus3(*sum, times3(c, spread3(vload3(0, light->colour))));
}

// Ambient light and emission.
inline Vec unlit_light(const Scene *scene, const Surface *s)
{
    const Vec ambient = spread3(vload3(0, scene->numbers->ambient));
    const Vec emission = PHYSICAL ? s->emission : spread3(s->material->emission);
    const int metallic = PHYSICAL && is_metallic(s->material);
    return plus3(times3(metallic ? ambient_reflectance(s) : s->albedo, ambient), emission);
}

#endif
