// The hits of a block, from its regions by plane equations.
#pragma once
#include "block_light.cl"

inline void set_up_equations(const Scene *s, const Bundle *r, const TriangleRow *triangles,
                             global PlaneEquations *out)
{
    WideEquations wide;
    WideAffine weights[3];
    set_up_lanes(s, r, triangles, weights, &wide);
    if (SMOOTH || SLOTS > COORDINATES) set_up_attributes(s, triangles, weights, &wide);
    for (int lane = 0; lane < triangles->count; ++lane, ++out) {
        const float *from = (const float *)&wide + lane;
        global float *to = (global float *)out;
        for (int k = 0; k < sizeof(WideEquations) / sizeof(vf); ++k) to[k] = from[k * LANES];
        out->key = s->material_ids[triangles->ids[lane]] * MIP_LEVELS;
        if (BAKED) vstore3(vload3(triangles->ids[lane], s->grids), 0, out->grid);
    }
}

inline HitRow interpolate(global const PlaneEquations *p, Row at)
{
    HitRow s;
    const vf denominator = affine_row(p->denominator, at);
    s.depth = affine_row(p->numerator, at) * reciprocal(denominator);
    // Some rays of a block may hit the other side of a flat triangle.
    for (int k = NORMAL; k < FIRST_ATTRIBUTE; ++k)
        s.value[k] = flip_sign(p->slot[k].term[ONE], sign_of(denominator));
    if (SMOOTH || QUANTITIES > COORDINATES)
        interpolate_attributes(p, at, sign_of(denominator), &s);
    return s;
}

// One block on its way from regions to hits.
typedef struct {
    Bundle bundle;
    Regions regions;
    global PlaneEquations *equations;  // of each region
} Block;

// Interpolate the row that begins with ray `at`, region by region.
inline void interpolate_row(const Block *b, int at, Row row, HitRow *s)
{
    s->key = s->triangle = -1;
    for (int n = 0; n < b->regions.row_count[at / LANES]; ++n) {
        const int k = b->regions.row_regions[at / LANES][n];
        const vi mask = region_row(b->regions.region + k, at);
        const HitRow hit = interpolate(b->equations + k, row);
        s->key = pick_int(s->key, (vi)(b->equations[k].key), mask);
        s->triangle = pick_int(s->triangle, (vi)(b->regions.region[k].triangle), mask);
        s->first = n ? pick_int(s->first, hit.first, mask) : hit.first;
        s->side = n ? pick_int(s->side, hit.side, mask) : hit.side;
        s->depth = n ? pick(s->depth, hit.depth, mask) : hit.depth;
        for (int q = 0; q < QUANTITIES; ++q)
            s->value[q] = n ? pick(s->value[q], hit.value[q], mask) : hit.value[q];
    }
}

// Set up the plane equations of a block's regions, LANES at a time, and list their shading keys.
inline void set_up_regions(const Scene *scene, float pixel_pitch, const Block *b, global Hits *out)
{
    const int count = b->regions.count;
    global const Region *region = b->regions.region;
    for (int first = 0; first < count; first += LANES) {
        TriangleRow triangles = {min(LANES, count - first)};
        for (int k = 0; k < LANES; ++k)
            triangles.ids[k] = region[min(first + k, count - 1)].triangle;
        set_up_equations(scene, &b->bundle, &triangles, b->equations + first);
    }
    out->key_count = 0;
    for (int k = 0; k < count; ++k) {
        if (TEXTURED || PHYSICAL)
            set_up_texture(scene, region[k].triangle, pixel_pitch, b->equations + k);
        add_key(b->equations[k].key, out);
    }
}

// Interpolate a block's hits. `light`: baked light as an affine function of the rays; 0: look it
// up.
inline void interpolate_rows(const Scene *scene, const Block *b, const Affine *light,
                             global Hits *out)
{
    const Bundle *r = &b->bundle;
    HitRow s = {0};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Row row = row_at(at, b->bundle.half_extent);
        interpolate_row(b, at, row, &s);
        const Vec direction = direction_row(r, row);
        store3(direction, out->direction, at);
        VSTORE(s.key, out->key + at);
        VSTORE(s.triangle, out->triangle + at);
        if (!row_any(GE(s.key, (vi)(0)))) continue;
        const Vec point = {fma(s.depth, direction.x, row_ox(r, row)),
                           fma(s.depth, direction.y, (vf)(row_oy(r, row))), s.depth};
        if (SMOOTH) turn_to_viewer(direction, &s);
        if (BAKED && !light) look_up_light(scene, &s);
        for (int k = 0; light && k < 3; ++k) s.value[BAKED_LIGHT + k] = affine_row(light[k], row);
        write_hits(&s, point, at, out);
    }
}

inline void find_block_hits(const Scene *scene, float pixel_pitch, const Block *b,
                            global Hits *out)
{
    set_up_regions(scene, pixel_pitch, b, out);
    Affine light[3];
    // With several regions a fit costs as much as it saves.
    const int fits = BAKED && OUTER == 1 && b->regions.count == 1 &&
        fit_light(scene, region_rectangle(b->regions.region, b->bundle.half_extent), b->equations,
                  light);
    // Two calls, so that the compiler makes a loop for each.
    if (fits) interpolate_rows(scene, b, light, out);
    else interpolate_rows(scene, b, 0, out);
}
