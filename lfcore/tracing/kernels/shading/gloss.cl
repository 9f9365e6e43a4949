// Highlights of Blinn-Phong materials, and microfacets (GGX) of metallic-roughness materials.
//
// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH
// 1977; Khronos, "glTF 2.0 Specification", appendix B; B. Walter et al., "Microfacet Models for
// Refraction through Rough Surfaces", EGSR 2007; C. Schlick, "An Inexpensive BRDF Model for
// Physically-based Rendering", 1994.
#pragma once
#include "powers.cl"
#include "surface.cl"

// A highlight: a power of the cosine between the normal and halfway to the viewer.
inline vf highlight(const Surface *s, Vec towards, vi facing)
{
    const Vec h = plus3(towards, s->to_viewer);
    const vf halfway = dot3(s->normal, h) * inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT)));
    const vi glossy = facing & GE(halfway, (vf)(s->material->record.specular_cutoff));
    if (!row_any(glossy)) return 0.0f;
    const vf cosine = max(halfway, (vf)(NOTHING_LEFT));
    const vf power = exp2_fast(s->material->record.shininess * log2_fast(cosine));
    return pick((vf)(0.0f), power, glossy);
}

// The Fresnel reflectance at normal incidence, of metals and of dielectrics.
inline vf f0(const Surface *s, vf albedo)
{
    return fma(s->metallic, albedo - DIELECTRIC, (vf)(DIELECTRIC));
}

// pi D V of microfacets: D = alpha2 / (pi ((N . H)^2 (alpha2 - 1) + 1)^2), written without the
// difference of nearly equal numbers, and V = 1 / (S(N . L) S(N . V)),
// S(c) = c + sqrt(alpha2 + (1 - alpha2) c^2).
inline vf microfacets(const Surface *s, Vec h, vf cosine, vf viewed)
{
    const vf halfway = dot3(s->normal, h);
    const Vec beside = cross3(s->normal, h);
    const vf d = fma(halfway * halfway, s->alpha2, dot3(beside, beside));
    const vf rest = 1.0f - s->alpha2;
    const vf light = cosine + sqrt(fma(rest, cosine * cosine, s->alpha2));
    const vf view = viewed + sqrt(fma(rest, viewed * viewed, s->alpha2));
    return s->alpha2 / (d * d * light * view);
}

// The reflected share of a light: diffuse (1 - F) and specular F, F by Schlick.
inline vf reflected(const Surface *s, vf albedo, vf grazing, vf specular)
{
    const vf base = f0(s, albedo), fresnel = fma(1.0f - base, grazing, base);
    return fma(1.0f - fresnel, albedo * (1.0f - s->metallic), fresnel * specular);
}
inline Vec reflect_light(const Surface *s, Vec towards, vf cosine, vf attenuation)
{
    Vec h = plus3(towards, s->to_viewer);
    h = scale3(h, inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT))));
    const vf specular = microfacets(s, h, cosine, fabs(dot3(s->normal, s->to_viewer)));
    const vf off = max(1.0f - dot3(s->to_viewer, h), (vf)(0.0f)), off2 = off * off;
    const vf grazing = off2 * off2 * off;
    const Vec c = {reflected(s, s->albedo.x, grazing, specular),
                   reflected(s, s->albedo.y, grazing, specular),
                   reflected(s, s->albedo.z, grazing, specular)};
    // The terms of light from behind may be infinite.
    const vi facing = GT(attenuation, (vf)(0.0f));
    return pick3(spread3((float3)(0.0f)), scale3(c, cosine * attenuation), facing);
}

// The reflected share of ambient light: diffuse, and specular at normal incidence.
inline Vec ambient_reflectance(const Surface *s)
{
    const Vec a = s->albedo;
    const Vec base = {f0(s, a.x), f0(s, a.y), f0(s, a.z)};
    return fma3(1.0f - s->metallic, a, base);
}
