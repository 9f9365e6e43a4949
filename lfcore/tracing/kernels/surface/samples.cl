// The hit of each ray of a block: point, normal, texture coordinates, tint and shading key.
#pragma once
#include "baked.cl"

typedef struct {
    float point[3 * BLOCK_RAYS];  // where the ray hits the surface
    float of[QUANTITIES][BLOCK_RAYS];
    int key[BLOCK_RAYS];          // shading key; -1 where nothing is hit
    int triangle[BLOCK_RAYS];     // -1 where nothing is hit
} Samples;

// A surface's material and one mip level of its textures (height 0: none; without PHYSICAL only the
// first).  A shading key names both, material * MIP_LEVELS + level.
typedef struct { MaterialRecord of; Level maps[MAPS]; } Material;

// A row of rays' surfaces, of one material, which is shaded together.
typedef struct {
    const Material *material;
    Vec albedo, point;
    Vec normal;                     // of unit length
    Vec to_viewer;                  // of unit length; only specular materials have it
    Vec geometric, emission;        // PHYSICAL alone: the normal before the normal map
    vf metallic, alpha2;            // likewise: the fourth power of roughness
    Vec light;                      // BAKED alone: arrives from sky and surfaces
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
        out->key = s->material_ids[triangles->of[lane]] * MIP_LEVELS;
        if (BAKED) vstore3(vload3(triangles->of[lane], s->grids), 0, out->grid);
    }
}

inline SampleRow interpolate(global const PlaneEquations *p, Row at)
{
    SampleRow s;
    const vf denominator = affine_row(p->denominator, at);
    s.depth = affine_row(p->numerator, at) * reciprocal(denominator);
    // Some rays of a block may see a flat triangle's other side.
    for (int k = NORMAL; k < FIRST_ATTRIBUTE; ++k)
        s.of[k] = flip_sign(p->slot[k].of[ONE], sign_of(denominator));
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
        const vi mask = region_row(b->regions.of + k, at);
        const SampleRow one = interpolate(b->equations + k, row);
        s->key = pick_int(s->key, (vi)(b->equations[k].key), mask);
        s->triangle = pick_int(s->triangle, (vi)(b->regions.of[k].triangle), mask);
        s->first = n ? pick_int(s->first, one.first, mask) : one.first;
        s->side = n ? pick_int(s->side, one.side, mask) : one.side;
        s->depth = n ? pick(s->depth, one.depth, mask) : one.depth;
        for (int q = 0; q < QUANTITIES; ++q)
            s->of[q] = n ? pick(s->of[q], one.of[q], mask) : one.of[q];
    }
}

// Set up the plane equations of a block's regions, LANES at a time.
inline void set_up_regions(const Scene *scene, float pixel_pitch, const Block *b)
{
    const int count = b->regions.count;
    global const Region *of = b->regions.of;
    for (int first = 0; first < count; first += LANES) {
        TriangleRow triangles = {min(LANES, count - first)};
        for (int k = 0; k < LANES; ++k) triangles.of[k] = of[min(first + k, count - 1)].triangle;
        set_up_equations(scene, &b->bundle, &triangles, b->equations + first);
    }
    for (int k = 0; k < count && (TEXTURED || PHYSICAL); ++k)
        set_up_texture(scene, of[k].triangle, pixel_pitch, b->equations + k);
}

// `light`: baked, an affine function of the block's rays; 0 where it is looked up.
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
        for (int k = 0; light && k < 3; ++k) s.of[BAKED_LIGHT + k] = affine_row(light[k], row);
        for (int k = 0; k < QUANTITIES; ++k) VSTORE(s.of[k], out->of[k] + at);
    }
}

inline void sample_block(const Scene *scene, float pixel_pitch, Block *b)
{
    set_up_regions(scene, pixel_pitch, b);
    Affine light[3];
    // With several regions a fit takes as long as it saves.
    const int fits = BAKED && OUTER == 1 && b->regions.count == 1 &&
        fit_light(scene, region_rectangle(b->regions.of, b->bundle.half_extent), b->equations,
                  light);
    // Two calls, so that each way has a loop of its own.
    if (fits) sample_rows(scene, b, light);
    else sample_rows(scene, b, 0);
}
