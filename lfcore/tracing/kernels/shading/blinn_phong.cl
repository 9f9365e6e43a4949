// Light that a surface sends back to the lens: ambient, emission, and Blinn-Phong of each light.
//
// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH
// 1977.
#ifndef LFCORE_BLINN_PHONG_CL
#define LFCORE_BLINN_PHONG_CL
#include "samples.cl"

// A row of rays' surfaces, of one material.
typedef struct {
    const Material *material;
    Colour albedo;
    Vec point, normal, view;  // normal and direction to the viewer are of unit length
} Surface;

inline void add_colour(Colour *sum, vf amount, float3 colour)
{
    sum->r = fma(amount, (vf)(colour.x), sum->r);
    sum->g = fma(amount, (vf)(colour.y), sum->g);
    sum->b = fma(amount, (vf)(colour.z), sum->b);
}

inline Colour pick_colour(Colour a, Colour b, vi mask)
{
    const Colour c = {pick(a.r, b.r, mask), pick(a.g, b.g, mask), pick(a.b, b.b, mask)};
    return c;
}

// The direction of unit length to a light; `strength` receives what distance and an emitter's own
// cosine leave of it.
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
    if (any(n != 0.0f)) *strength *= max(-dot3(l, spread3(n)), (vf)(0.0f));
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

// Add what one light gives the rays that see it.
inline void add_light(global const float *light, const Surface *s, vi seeing, Colour *sum)
{
    vf strength;
    const Vec towards = towards_light(light, s->point, &strength);
    const vf cosine = dot3(s->normal, towards);
    const vi facing = seeing & GT(cosine, (vf)(0.0f));
    const vf diffuse = pick((vf)(0.0f), cosine * strength, facing);
    Colour c = {s->albedo.r * diffuse, s->albedo.g * diffuse, s->albedo.b * diffuse};
    if (is_glossy(s->material))
        add_colour(&c, highlight(s, towards, facing) * strength, s->material->specular);
    const float3 colour = light_colour(light);
    sum->r += c.r * colour.x;
    sum->g += c.g * colour.y;
    sum->b += c.b * colour.z;
}

// What a surface sends back without lights.
inline Colour own_light(const Scene *scene, const Surface *s)
{
    const float3 ambient = vload3(0, scene->numbers->ambient), emission = s->material->emission;
    const Colour c = {s->albedo.r * ambient.x + emission.x, s->albedo.g * ambient.y + emission.y,
                      s->albedo.b * ambient.z + emission.z};
    return c;
}

#endif
