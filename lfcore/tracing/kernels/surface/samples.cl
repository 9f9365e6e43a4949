// The hit of each ray of a block: point, normal, texture coordinates, tint and shading key.
#pragma once
#include "baked.cl"

typedef struct {
    float point[3 * BLOCK_RAYS];  // where the ray hits the surface
    float value[QUANTITIES][BLOCK_RAYS];
    int key[BLOCK_RAYS];          // shading key; -1 where nothing is hit
    int triangle[BLOCK_RAYS];     // -1 where nothing is hit
} Samples;

// A surface's material and one mip level of its textures (height 0: none; without PHYSICAL only the
// first).  A shading key names both, material * MIP_LEVELS + level.
typedef struct { MaterialRecord record; Level maps[MAPS]; } Material;

// The surfaces of a row of rays with one material, which are shaded together.
typedef struct {
    const Material *material;
    Vec albedo, point;
    Vec normal;                     // of unit length
    Vec to_viewer;                  // of unit length, only for specular materials
    Vec geometric_normal, emission;  // PHYSICAL: the normal without the normal map
    vf metallic, alpha2;            // PHYSICAL: the fourth power of roughness
    Vec light;                      // BAKED: irradiance by sky and surfaces, over pi
} Surface;

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

inline SampleRow interpolate(global const PlaneEquations *p, Row at)
{
    SampleRow s;
    const vf denominator = affine_row(p->denominator, at);
    s.depth = affine_row(p->numerator, at) * reciprocal(denominator);
    // Some rays of a block may hit the other side of a flat triangle.
    for (int k = NORMAL; k < FIRST_ATTRIBUTE; ++k)
        s.value[k] = flip_sign(p->slot[k].term[ONE], sign_of(denominator));
    if (SMOOTH || QUANTITIES > COORDINATES)
        interpolate_attributes(p, at, sign_of(denominator), &s);
    return s;
}

// One block on its way from regions to colours.
typedef struct {
    Bundle bundle;
    Regions regions;
    global PlaneEquations *equations;  // of each region
    global Samples *samples;
    global int *lit;                // (shadow lights, BLOCK) a bit for each ray that sees the light
} Block;

// Interpolate the row that begins with ray `at`, region by region.
inline void sample_row(const Block *b, int at, Row row, SampleRow *s)
{
    s->key = s->triangle = -1;
    for (int n = 0; n < b->regions.row_count[at / LANES]; ++n) {
        const int k = b->regions.row_regions[at / LANES][n];
        const vi mask = region_row(b->regions.region + k, at);
        const SampleRow hit = interpolate(b->equations + k, row);
        s->key = pick_int(s->key, (vi)(b->equations[k].key), mask);
        s->triangle = pick_int(s->triangle, (vi)(b->regions.region[k].triangle), mask);
        s->first = n ? pick_int(s->first, hit.first, mask) : hit.first;
        s->side = n ? pick_int(s->side, hit.side, mask) : hit.side;
        s->depth = n ? pick(s->depth, hit.depth, mask) : hit.depth;
        for (int q = 0; q < QUANTITIES; ++q)
            s->value[q] = n ? pick(s->value[q], hit.value[q], mask) : hit.value[q];
    }
}

// Set up the plane equations of a block's regions, LANES at a time.
inline void set_up_regions(const Scene *scene, float pixel_pitch, const Block *b)
{
    const int count = b->regions.count;
    global const Region *region = b->regions.region;
    for (int first = 0; first < count; first += LANES) {
        TriangleRow triangles = {min(LANES, count - first)};
        for (int k = 0; k < LANES; ++k)
            triangles.ids[k] = region[min(first + k, count - 1)].triangle;
        set_up_equations(scene, &b->bundle, &triangles, b->equations + first);
    }
    for (int k = 0; k < count && (TEXTURED || PHYSICAL); ++k)
        set_up_texture(scene, region[k].triangle, pixel_pitch, b->equations + k);
}

// Interpolate a block's samples. `light`: baked light as an affine function of the rays; 0: look it
// up.
inline void sample_rows(const Scene *scene, const Block *b, const Affine *light)
{
    global Samples *out = b->samples;
    const Bundle *r = &b->bundle;
    SampleRow s = {0};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Row row = row_at(at, b->bundle.half_extent);
        sample_row(b, at, row, &s);
        VSTORE(s.key, out->key + at);
        VSTORE(s.triangle, out->triangle + at);
        if (!row_any(GE(s.key, (vi)(0)))) continue;
        const Vec direction = direction_row(r, row);
        const Vec point = {fma(s.depth, direction.x, row_ox(r, row)),
                           fma(s.depth, direction.y, (vf)(row_oy(r, row))), s.depth};
        store3(point, out->point, at);
        if (SMOOTH) turn_to_viewer(direction, &s);
        if (BAKED && !light) look_up_light(scene, &s);
        for (int k = 0; light && k < 3; ++k) s.value[BAKED_LIGHT + k] = affine_row(light[k], row);
        for (int k = 0; k < QUANTITIES; ++k) VSTORE(s.value[k], out->value[k] + at);
    }
}

inline void sample_block(const Scene *scene, float pixel_pitch, Block *b)
{
    set_up_regions(scene, pixel_pitch, b);
    Affine light[3];
    // With several regions a fit costs as much as it saves.
    const int fits = BAKED && OUTER == 1 && b->regions.count == 1 &&
        fit_light(scene, region_rectangle(b->regions.region, b->bundle.half_extent), b->equations,
                  light);
    // Two calls, so that the compiler makes a loop for each.
    if (fits) sample_rows(scene, b, light);
    else sample_rows(scene, b, 0);
}
