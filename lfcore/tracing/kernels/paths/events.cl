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
#include "rough.cl"

// The volumes that a ray is in, the last one first: materials, -1 none.
typedef struct { vi first, second; } Media;

inline Media without(Media m, int material)
{
    const vi is_first = EQ(m.first, (vi)(material)), is_second = EQ(m.second, (vi)(material));
    return (Media){pick_int(m.first, m.second, is_first),
                   pick_int(m.second, (vi)(-1), is_first | is_second)};
}

inline vi all_if(int condition) { return (vi)(condition ? -1 : 0); }

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
    vf opacity;
    vf eta;      // index in front over that behind
    vi mirrors, rough;  // whether the base mirrors rays, and whether it scatters them a little
    vi goes_on;  // whether a ray goes on
    Media behind;
} Events;

inline int has_traced_coat(const Material *m)
{
    return m->record.clearcoat > 0.0f && m->record.clearcoat_roughness <= TRACED_ROUGHNESS;
}

// The squared roughness of a coat that is traced; 0 for a plain mirror.
inline float rough_coat(const Material *m)
{
    const float roughness = m->record.clearcoat_roughness;
    return has_traced_coat(m) && roughness > MIRROR_ROUGHNESS ? roughness * roughness : 0.0f;
}

inline vf metal_of(const Surface *s) { return is_metallic(s->material) ? s->metallic : (vf)(0.0f); }

// The reflectance of the dielectric at a cosine.
inline vf sharp_at(const Surface *s, const Events *e, vf cosine)
{
    const vf sharp = dielectric(cosine, e->eta);
    const MaterialRecord *m = &s->material->record;
    return m->transmission > 0.0f && m->thin_walled ? 2.0f * sharp / (1.0f + sharp) : sharp;
}

// The reflectance of the base at a cosine and its `sharp`.
inline Vec base_reflectance(const Surface *s, const Events *e, vf cosine, vf sharp)
{
    const vf off = max(1.0f - cosine, (vf)(0.0f)), off2 = off * off, grazing = off2 * off2 * off;
    const vf metal = metal_of(s);
    Vec reflected = scale3(fma3(grazing, minus3(spread3(1.0f), s->albedo), s->albedo), metal);
    reflected = fma3((1.0f - metal) * sharp, spread3(1.0f), reflected);
    return pick3(spread3(0.0f), reflected, e->mirrors);
}

inline vf coat_share(const Surface *s, vf cosine)
{
    if (!has_traced_coat(s->material)) return 0.0f;
    return s->material->record.clearcoat * dielectric(cosine, (vf)(1.0f / COAT));
}

// `media` are those in front, `front` is the mask of rays that meet the front.
inline Events find_events(const Scene *scene, int number, vf opacity, Media media, vi front,
                          Surface *s)
{
    const MaterialRecord *m = &s->material->record;
    const int physical = is_metallic(s->material), glass = m->transmission > 0.0f;
    const int coat = has_traced_coat(s->material);
    const vf metal = metal_of(s), cosine = dot3(s->normal, s->to_viewer);
    Events e = {.opacity = opacity, .eta = 1.0f / m->ior, .behind = media,
                .mirrors = glass ? (vi)(-1)
                    : physical ? LE(s->roughness, (vf)(TRACED_ROUGHNESS)) : (vi)(0)};
    e.rough = e.mirrors & (glass ? (vi)(0) : GT(s->roughness, (vf)(MIRROR_ROUGHNESS)));
    if (is_volume(s->material)) {
        const Media left = without(media, number);
        const vf around = index_of(scene, pick_int(left.first, media.first, front));
        e.eta = pick(m->ior / around, around / m->ior, front);
        e.behind.first = pick_int(left.first, (vi)(number), front);
        e.behind.second = pick_int(left.second, media.first, front);
    }
    const vf sharp = sharp_at(s, &e, cosine), shield = coat_share(s, cosine);
    const Vec white = spread3(1.0f);
    e.own = opacity * (1.0f - shield);
    e.mirrored = fma3(e.own, base_reflectance(s, &e, cosine, sharp),
                      scale3(white, opacity * shield));
    const vf through = e.own * (1.0f - metal) * m->transmission * (1.0f - sharp);
    e.passed = fma3(through, s->albedo, scale3(white, 1.0f - opacity));
    const vf most = max(max(max(e.mirrored.x, e.mirrored.y), max(e.mirrored.z, e.passed.x)),
                        max(e.passed.y, e.passed.z));
    e.goes_on = GT(most, (vf)(0.0f));
    const vf scattered = (1.0f - metal) * (1.0f - pick((vf)(0.0f), sharp, e.mirrors));
    s->lacking = (Lacking){
        .matt = 1.0f - m->transmission, .scattered = scattered * (1.0f - m->transmission),
        .glossy = physical ? ~e.mirrors : (vi)(0),
        .dull = e.mirrors | all_if(coat && !physical),
        .rough = e.rough | all_if(rough_coat(s->material) > 0.0f)};
    return e;
}

inline vf mean_of(Vec a) { return (a.x + a.y + a.z) * (1.0f / 3.0f); }

// A ray that meets a rough mirror meets one microfacet, of the base or of the coat; its two numbers
// choose which.
// Its normal takes the place of `normal`, and its share that of both, divided by the chance that it
// is met.  Returns the spread of the part of the lobe that a ray stands for; 0 for plain mirrors.
inline vf meet_facets(const Surface *s, const vf number[2], Events *e, Vec *normal)
{
    const float of_coat = rough_coat(s->material);
    const vi rough = e->rough | all_if(of_coat > 0.0f);
    if (!row_any(rough)) return 0.0f;
    const vf least = NOTHING_LEFT, cosine = max(dot3(*normal, s->to_viewer), least);
    const vf shield = e->opacity * coat_share(s, cosine);
    const vf chance = min(shield / max(mean_of(e->mirrored), least), (vf)(1.0f));
    const vi coat = LT(number[1], chance);
    const vf share = max(pick(1.0f - chance, chance, coat), least);
    const vf rest = (number[1] - pick(chance, (vf)(0.0f), coat)) / share;
    const vf of_base = pick((vf)(0.0f), s->roughness * s->roughness, e->rough);
    const vf alpha = pick(of_base, (vf)(of_coat), coat);
    const Vec facet = find_facet(*normal, s->to_viewer, alpha, number[0], min(rest, (vf)(1.0f)));
    const vf seen = dot3(facet, s->to_viewer), up = dot3(facet, *normal);
    const vf leaving = fma(2.0f * seen, up, -cosine);
    const Vec base = scale3(base_reflectance(s, e, seen, sharp_at(s, e, seen)), e->own);
    const vf of_both = e->opacity * coat_share(s, seen);
    const Vec shown = pick3(base, (Vec){of_both, of_both, of_both}, coat);
    const vf kept = pick((vf)(0.0f), unhidden(leaving, alpha) / share, GT(leaving, least));
    e->mirrored = pick3(e->mirrored, scale3(shown, kept), rough);
    *normal = pick3(*normal, facet, rough);
    return pick((vf)(0.0f), LOBE_PART * lobe_width(cosine, up, alpha), rough);
}

// The own light of surfaces in the share `own`, and all of it where no ray goes `on`.
inline Vec shared_light(const Scene *scene, Surface *s, global const int *lit, int at, vf own,
                        vi on)
{
    const int physical = is_metallic(s->material);
    s->lacking.matt = pick((vf)(1.0f), s->lacking.matt, on);
    s->lacking.scattered = pick((vf)(1.0f), s->lacking.scattered, on);
    s->lacking.glossy |= ~on & all_if(physical);
    s->lacking.dull &= on;
    return scale3(own_light(scene, s, lit, at), pick((vf)(1.0f), own, on));
}

// Unit normals of the triangles that the rays `mine` of a row hit, and their corners.
inline Vec read_planes(const Scene *s, global const Hits *hits, int at, vi mine,
                       TriangleRow *triangles, Vec *corner)
{
    const int any = hits->triangle[at + lowest(row_bits(mine))];
    triangles->count = LANES;
    VSTORE(pick_int((vi)(any), VLOAD(hits->triangle + at), mine), triangles->ids);
    read_corners(s, triangles, corner);
    return directions_of(geometric_normals(corner));
}

// The share of light that meets the surfaces of a row.
inline vf opacity_row(const AlphaTests *tests, global const Hits *hits, const Material *m, int at)
{
    private float opacity[LANES];
    for (int k = 0; k < LANES; ++k) {
        const int id = hits->triangle[at + k];
        opacity[k] = m->record.opacity;
        // A row may have rays of other materials, whose triangles have no picture of alpha.
        if (!m->record.alpha_blend || id < 0 || !has_holes(tests, id)) continue;
        global const AlphaTest *image = tests->records + tests->record_of[id];
        opacity[k] *= alpha_at(tests->alpha, image, hits->value[COORDINATES][at + k],
                               hits->value[COORDINATES + 1][at + k]) / 255.0f;
    }
    return VLOAD(opacity);
}

// Which rays pass a surface as if it were not there: where it is a hole, and where they leave a
// volume that they are not in first.
inline vi find_idle(vi front, Media media, const Material *m, int number, vf opacity)
{
    const vi foreign = ~front & ~EQ(media.first, (vi)(number));
    return (foreign & all_if(is_volume(m))) | EQ(opacity, (vf)(0.0f));
}

// The own light of the rays `mine` of a row whose first surfaces send rays on.
inline Vec first_light(const Scene *scene, const AlphaTests *tests, global const Hits *hits,
                       global const int *lit, int at, vi mine, Surface *s)
{
    const int number = hits->key[at + lowest(row_bits(mine))] / MIP_LEVELS;
    const Media none = {-1, -1};
    Vec corner[3];
    TriangleRow triangles;
    const Vec n = read_planes(scene, hits, at, mine, &triangles, corner);
    const vi front = LT(dot3(n, load3(hits->direction, at)), (vf)(0.0f));
    const vf opacity = opacity_row(tests, hits, s->material, at);
    const vi idle = find_idle(front, none, s->material, number, opacity);
    const Events e = find_events(scene, number, opacity, none, front, s);
    const Vec light = shared_light(scene, s, lit, at, e.own, e.goes_on & ~idle);
    return pick3(light, spread3(0.0f), idle);
}
