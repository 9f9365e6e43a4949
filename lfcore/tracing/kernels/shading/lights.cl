// Light that a surface sends back to the lens: ambient, emission, and what it reflects of each
// light, by Blinn-Phong unless its material is of metal and roughness.
//
// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH
// 1977.
#ifndef LFCORE_LIGHTS_CL
#define LFCORE_LIGHTS_CL
#include "metal.cl"

// The direction of unit length to a light; `strength` receives what distance, an emitter's
// own cosine and a cone leave of it.
inline Vec towards_light(global const float *light, Vec point, vf *strength)
{
    *strength = 1.0f;
    const Vec vector = spread3(light_vector(light));
    if (!is_point(light)) return vector;
    Vec l = minus3(vector, point);
    const vf inverse = inverse_sqrt(dot3(l, l));
    l = scale3(l, inverse);
    const float reference = reference_distance(light);
    if (reference > 0.0f) *strength = reference * inverse * (reference * inverse);
    const float3 n = emitter_normal(light);
    if (any(n != 0.0f)) {
        vf cosine = max(-dot3(l, spread3(n)), (vf)(0.0f));
        const float2 cone = light_cone(light);
        if (cone.x > 0.0f) {
            cosine = clamp(fma(cosine, (vf)(cone.x), (vf)(cone.y)), (vf)(0.0f), (vf)(1.0f));
            cosine *= cosine;
        }
        *strength *= cosine;
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
    const Vec h = {towards.x + s->view.x, towards.y + s->view.y, towards.z + s->view.z};
    const vf halfway = dot3(s->normal, h) * inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT)));
    const vi glossy = facing & GE(halfway, (vf)(s->material->dull));
    if (!row_any(glossy)) return 0.0f;
    const vf cosine = max(halfway, (vf)(NOTHING_LEFT));
    const vf power = exp2_fast(s->material->shininess * log2_fast(cosine));
    return pick((vf)(0.0f), power, glossy);
}

// What Blinn-Phong surfaces reflect.
inline Colour reflect_plainly(const Surface *s, Vec towards, vf cosine, vf strength, vi facing)
{
    const vf diffuse = pick((vf)(0.0f), cosine * strength, facing);
    Colour c = {s->albedo.r * diffuse, s->albedo.g * diffuse, s->albedo.b * diffuse};
    if (is_glossy(s->material))
        add_colour(&c, highlight(s, towards, facing) * strength, s->material->specular);
    return c;
}

// Add what one light gives the rays that see it.
inline void add_light(global const float *light, const Surface *s, vi seeing, Colour *sum)
{
    vf strength;
    const Vec towards = towards_light(light, s->point, &strength);
    const vf cosine = dot3(s->normal, towards);
    vi facing = seeing & GT(cosine, (vf)(0.0f));
    if (PHYSICAL) facing &= GT(dot3(s->unbent, towards), (vf)(0.0f));
    Colour c;
    if (PHYSICAL && is_metallic(s->material))
        c = reflect_light(s, towards, cosine, pick((vf)(0.0f), strength, facing));
    else c = reflect_plainly(s, towards, cosine, strength, facing);
    const float3 colour = light_colour(light);
    sum->r += c.r * colour.x;
    sum->g += c.g * colour.y;
    sum->b += c.b * colour.z;
}

// What a surface sends back without lights.
inline Colour own_light(const Scene *scene, const Surface *s)
{
    const float3 ambient = vload3(0, scene->numbers->ambient), emission = s->material->emission;
    Colour c = s->albedo, glow = {emission.x, emission.y, emission.z};
    if (PHYSICAL) {
        glow = s->glow;
        if (is_metallic(s->material)) {
            c.r = surrounding(s, c.r);
            c.g = surrounding(s, c.g);
            c.b = surrounding(s, c.b);
        }
    }
    c.r = c.r * ambient.x + glow.r;
    c.g = c.g * ambient.y + glow.g;
    c.b = c.b * ambient.z + glow.b;
    return c;
}

#endif
