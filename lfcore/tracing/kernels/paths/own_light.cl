// The own light of specular surfaces: emission, diffuse reflection and highlights, without what
// mirrored rays and rays that pass bring.
#pragma once
#include "shade.cl"

// The diffuse reflection and the highlight of a light on the rays `seeing` it.
inline void reflect_parts(global const LightRecord *light, const Surface *s, vi seeing, Vec *matt,
                          Vec *shine)
{
    vf attenuation;
    const Vec towards = towards_light(light, s->point, &attenuation);
    const vf cosine = dot3(s->normal, towards);
    const vi facing = seeing & GT(cosine, (vf)(0.0f)) &
                      GT(dot3(s->smooth_normal, towards), (vf)(0.0f));
    attenuation = pick((vf)(0.0f), attenuation, facing);
    *matt = scale3(s->albedo, pick((vf)(0.0f), cosine * attenuation, facing));
    *shine = spread3(0.0f);
    if (!is_metallic(s->material)) {
        if (is_glossy(s->material))
            *shine = scale3(spread3(vload3(0, s->material->record.specular)),
                            highlight(s, towards, facing) * attenuation);
        return;
    }
    Vec h = plus3(towards, s->to_viewer);
    h = scale3(h, inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT))));
    const vf peak = microfacets(s, h, cosine, fabs(dot3(s->normal, s->to_viewer)));
    const vf off = max(1.0f - dot3(s->to_viewer, h), (vf)(0.0f)), off2 = off * off;
    const vf grazing = off2 * off2 * off, arriving = cosine * attenuation, rest = 1.0f - s->metallic;
    const Vec base = {f0(s, s->albedo.x), f0(s, s->albedo.y), f0(s, s->albedo.z)};
    const Vec fresnel = fma3(grazing, minus3(spread3(1.0f), base), base);
    *matt = scale3(times3(minus3(spread3(1.0f), fresnel), *matt), rest);
    *shine = pick3(*shine, scale3(fresnel, peak * arriving), facing);
}

inline void add_own_light(global const LightRecord *light, const Surface *s, vi seeing, Vec colour,
                          Vec *sum)
{
    Vec matt, shine;
    reflect_parts(light, s, seeing, &matt, &shine);
    const vi dull = s->lacking.dull & (light->is_point ? (vi)(-1) : ~s->lacking.rough);
    if (light->visible) shine = pick3(shine, spread3(0.0f), dull);
    *sum = plus3(*sum, times3(fma3(s->lacking.matt, matt, shine), colour));
}

inline Vec own_light(const Scene *scene, const Surface *s, global const int *lit, int at)
{
    const SceneArguments *n = scene->numbers;
    const Vec ambient = BAKED ? s->light : spread3(vload3(0, n->ambient));
    Vec sum = times3(scale3(s->albedo, s->lacking.scattered), ambient);
    if (is_metallic(s->material)) {
        const Vec glossy = SKY && BAKED ? reflect_sky(scene, s) : times3(ambient_share(s), ambient);
        sum = pick3(sum, glossy, s->lacking.glossy);
    }
    sum = plus3(sum, emission_of(s));
    for (int k = 0; k < n->unshadowed_lights; ++k)
        add_own_light(scene->lights + k, s, (vi)(-1), spread3(vload3(0, scene->lights[k].colour)),
                      &sum);
    for (int k = 0; SHADOWS && k < n->shadow_lights; ++k) {
        const int seen = lit[k * BLOCK + at / BLOCK] >> at % BLOCK;
        add_own_light(scene->lights + n->unshadowed_lights + k, s, mask_of_bits(seen),
                      tinted_colour(scene, k, lit, at), &sum);
    }
    return sum;
}
