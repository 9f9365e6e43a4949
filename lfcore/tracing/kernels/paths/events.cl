// What specular surfaces do with rays: shares that are mirrored and that pass, and directions.
//
//     own = a (1 - K) (diffuse (1 - metal) (1 - F) (1 - transmission) + highlights + emission)
//     mirrored = a (K + (1 - K) R)
//     passed = a (1 - K) (1 - metal) transmission base (1 - F) + 1 - a
//
// with opacity a, the coat's strength times its reflectance K, the exact reflectance F of the
// dielectric, and R = (1 - metal) F + metal (base + (1 - base) (1 - cosine)^5).
//
// Source: Khronos, KHR_materials_transmission, _volume and _clearcoat.
#pragma once
#include "fresnel.cl"
#include "own_light.cl"

// The volumes that a ray is in, the last one first: materials, -1 none.
typedef struct { vi first, second; } Media;

inline Media without(Media m, int material)
{
    const vi is_first = EQ(m.first, (vi)(material)), is_second = EQ(m.second, (vi)(material));
    return (Media){pick_int(m.first, m.second, is_first),
                   pick_int(m.second, (vi)(-1), is_first | is_second)};
}

inline int is_volume(const Material *m)
{
    return m->record.transmission > 0.0f && !m->record.thin_walled;
}

inline vf index_of(const Scene *scene, vi media)
{
    private int number[LANES];
    private float index[LANES];
    VSTORE(media, number);
    for (int k = 0; k < LANES; ++k) index[k] = number[k] < 0 ? 1.0f : scene->materials[number[k]].ior;
    return VLOAD(index);
}

typedef struct {
    Vec mirrored, passed;
    vf own;      // the share of the surface's own light
    vf eta;      // index in front over that behind
    vi goes_on;  // whether a ray goes on
    Media behind;
} Events;

// `media` are those in front, `front` is the mask of rays that meet the front.
inline Events find_events(const Scene *scene, int number, vf opacity, Media media, vi front,
                          Surface *s)
{
    const MaterialRecord *m = &s->material->record;
    const int physical = is_metallic(s->material), glass = m->transmission > 0.0f;
    const vf metal = physical ? s->metallic : (vf)(0.0f);
    const vi mirrors = glass ? (vi)(-1) : physical ? LE(s->roughness, (vf)(MIRROR_ROUGHNESS)) : (vi)(0);
    const int coat = m->clearcoat > 0.0f && m->clearcoat_roughness <= MIRROR_ROUGHNESS;
    const vf cosine = dot3(s->normal, s->to_viewer);
    Events e = {.eta = 1.0f / m->ior, .behind = media};
    if (is_volume(s->material)) {
        const Media left = without(media, number);
        const vf around = index_of(scene, pick_int(left.first, media.first, front));
        e.eta = pick(m->ior / around, around / m->ior, front);
        e.behind.first = pick_int(left.first, (vi)(number), front);
        e.behind.second = pick_int(left.second, media.first, front);
    }
    vf sharp = dielectric(cosine, e.eta);
    if (glass && m->thin_walled) sharp = 2.0f * sharp / (1.0f + sharp);
    const vf off = max(1.0f - cosine, (vf)(0.0f)), off2 = off * off, grazing = off2 * off2 * off;
    const Vec base = s->albedo, white = spread3(1.0f);
    Vec reflected = scale3(fma3(grazing, minus3(white, base), base), metal);
    reflected = fma3((1.0f - metal) * sharp, white, reflected);
    reflected = pick3(spread3(0.0f), reflected, mirrors);
    const vf shield = coat ? m->clearcoat * dielectric(cosine, (vf)(1.0f / COAT)) : (vf)(0.0f);
    e.own = opacity * (1.0f - shield);
    e.mirrored = fma3(e.own, reflected, scale3(white, opacity * shield));
    const vf through = e.own * (1.0f - metal) * m->transmission * (1.0f - sharp);
    e.passed = fma3(through, base, scale3(white, 1.0f - opacity));
    const vf most = max(max(max(e.mirrored.x, e.mirrored.y), max(e.mirrored.z, e.passed.x)),
                        max(e.passed.y, e.passed.z));
    e.goes_on = GT(most, (vf)(0.0f));
    const vf scattered = (1.0f - metal) * (1.0f - pick((vf)(0.0f), sharp, mirrors));
    s->lacking = (Lacking){
        .matt = 1.0f - m->transmission, .scattered = scattered * (1.0f - m->transmission),
        .glossy = physical ? ~mirrors : (vi)(0), .dull = mirrors | (vi)(coat && !physical ? -1 : 0)};
    return e;
}

// Own light of surfaces at which no ray goes on.
inline void lack_nothing(vi mask, Surface *s)
{
    const int physical = is_metallic(s->material);
    s->lacking.matt = pick(s->lacking.matt, (vf)(1.0f), mask);
    s->lacking.scattered = pick(s->lacking.scattered, (vf)(1.0f), mask);
    s->lacking.glossy |= mask & (vi)(physical ? -1 : 0);
    s->lacking.dull &= ~mask;
}
