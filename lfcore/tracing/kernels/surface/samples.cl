// The hit of each ray of a block: point, normal, texture coordinates, tint and shading key.
#pragma once
#if BAKED || SKY
#include "baked.cl"
#else
#include "texture.cl"
#endif

// The quantities of a hit: slots of its triangle, tangent and the sign beside it, and light that
// arrives from sky and surfaces; those that a scene lacks have no place.
enum {
    BAKED_LIGHT = PLACE,  // after its place on a grid
    TANGENT = SLOTS + BAKED,
    QUANTITIES = TANGENT + TANGENT_WORDS
};
typedef struct {
    float point[3 * BLOCK_RAYS];  // where the ray meets the surface
    float of[QUANTITIES][BLOCK_RAYS];
    int key[BLOCK_RAYS];          // shading key; -1 where nothing is met
    int triangle[BLOCK_RAYS];     // -1 where nothing is met
} Samples;

// A surface's material and one mip level of its texture.  A shading key names both, material *
// MIP_LEVELS + level.
typedef struct {
    MaterialRecord of;
    Level maps[MAPS];  // height 0: no texture; without PHYSICAL the first alone
} Material;

// A row of rays' surfaces, of one material, which is shaded together.
typedef struct {
    const Material *material;
    Vec albedo, point;
    Vec normal;     // of unit length
    Vec to_viewer;  // direction to the viewer, of unit length; only specular materials have it
    // Scenes with PHYSICAL alone.
    Vec geometric;  // the normal before the normal map
    vf metallic;
    vf alpha2;      // the fourth power of roughness
    Vec emission;
    // Scenes with BAKED alone.
    Vec light;      // that arrives from sky and surfaces
} Surface;

// A row of rays that meet one triangle.
typedef struct {
    vf depth, of[QUANTITIES];
    vi key, triangle;
    vi first, side;  // of the grid of baked light
} SampleRow;

// Three of them, from `first` on.
inline Vec *vectors_at(SampleRow *s, int first) { return (Vec *)(s->of + first); }

inline SampleRow interpolate(global const PlaneEquations *p, Row at, int fitted)
{
    SampleRow s;
    const vf denominator = plane_row(p->denominator, at), weights = plane_row(p->weights, at);
    s.depth = plane_row(p->numerator, at) * reciprocal(denominator);
    // Some rays of a block may see a flat triangle's other side.
    for (int k = NORMAL; k < FIRST_ATTRIBUTE; ++k)
        s.of[k] = flip_sign(p->slot[k].of[ONE], sign_of(denominator));
    for (int k = FIRST_ATTRIBUTE; k < PLACE; ++k) s.of[k] = edge_row(p->slot[k], at);
    // Seen from behind, a flat triangle's tangent turns as its normal does; smooth ones turn later.
    const vi behind = sign_of(SMOOTH ? weights : -weights);
    for (int k = 0; k < 4 && PHYSICAL; ++k)
        s.of[TANGENT + k] = flip_sign(p->tangent[k], k < 3 ? behind : sign_of(denominator));
    if (SLOTS == COORDINATES) return s;
    if (fitted) {
        for (int k = 0; k < 3; ++k) s.of[BAKED_LIGHT + k] = plane_row(p->light[k], at);
        if (PLACE == COORDINATES) return s;
    }
    const vf inverse = reciprocal(weights);
    for (int k = COORDINATES; k < TINT; ++k) s.of[k] *= inverse;
    for (int k = TINT; k < PLACE; ++k) s.of[k] = fma(inverse, s.of[k], (vf)(p->first[k - TINT]));
    if (fitted) return s;
    for (int k = PLACE; k < SLOTS; ++k)
        s.of[k] = edge_row(p->slot[k], at) * (inverse * (float)p->grid[2]);
    // The corners turn to the viewer where the weights are negative.
    s.first = pick_int((vi)(p->grid[1]), (vi)(p->grid[0]), LT(weights, (vf)(0.0f)));
    s.side = p->grid[2];
    return s;
}

// Give interpolated normals unit length, and turn them to the viewer, and tangents with them.
inline void turn_to_viewer(Vec direction, SampleRow *s)
{
    Vec *n = vectors_at(s, NORMAL), *tangent = vectors_at(s, TANGENT);
    *n = scale3(*n, inverse_sqrt(max(dot3(*n, *n), (vf)(LEAST_LENGTH))));
    const vi away = GT(dot3(*n, direction), (vf)(0.0f)) & (vi)(0x80000000);
    *n = turn_vectors(*n, away);
    if (PHYSICAL) *tangent = turn_vectors(*tangent, away);
}

// One block on its way from regions to colours.
typedef struct {
    int number;                     // in its packet
    Bundle rays;
    Regions regions;
    global PlaneEquations *planes;  // of each region
    int fitted;                     // whether baked light is affine in each of them
    global Samples *samples;
    // (shadow lights, BLOCK) a bit for each ray that sees the light.
    global int *lit;
} Block;

// The regions that each row of LANES rays meets: as many as rays at the most.
#define RAY_ROWS (BLOCK_RAYS / LANES)
typedef struct { int count[RAY_ROWS]; uchar of[RAY_ROWS][LANES]; } RowRegions;

inline void list_regions(const Regions *regions, RowRegions *out)
{
    const int one = regions->count == 1;  // even of rows that it does not meet
    for (int row = 0; row < RAY_ROWS; ++row) {
        out->count[row] = one;
        out->of[row][0] = 0;
    }
    for (int k = 0; k < regions->count && !one; ++k) {
        global const Region *r = regions->of + k;
        for (int at = r->top * BLOCK; at < (r->bottom + 1) * BLOCK; at += LANES) {
            const int row = at / LANES;
            if (r->rows[at / BLOCK] >> at % BLOCK & ((1 << LANES) - 1))
                out->of[row][out->count[row]++] = k;
        }
    }
}

// Interpolate the row that begins with ray `at`, region by region.
inline void sample_row(const Scene *scene, const Block *b, const RowRegions *list, int at, Row row,
                       SampleRow *s)
{
    s->key = s->triangle = -1;
    for (int n = 0; n < list->count[at / LANES]; ++n) {
        const int k = list->of[at / LANES][n];
        global const Region *r = b->regions.of + k;
        const vi mask = region_row(r, at);
        const SampleRow one = interpolate(b->planes + k, row, b->fitted);
        s->key = pick_int(s->key, (vi)(b->planes[k].key), mask);
        s->triangle = pick_int(s->triangle, (vi)(r->triangle), mask);
        s->first = n ? pick_int(s->first, one.first, mask) : one.first;
        s->side = n ? pick_int(s->side, one.side, mask) : one.side;
        s->depth = n ? pick(s->depth, one.depth, mask) : one.depth;
        for (int q = 0; q < QUANTITIES; ++q)
            s->of[q] = n ? pick(s->of[q], one.of[q], mask) : one.of[q];
    }
}

// Set up the planes of a block's regions, LANES at a time.
inline void set_up_regions(const Scene *scene, float pixel, const Block *b)
{
    const int count = b->regions.count;
    global const Region *of = b->regions.of;
    for (int first = 0; first < count; first += LANES) {
        TriangleRow triangles = {min(LANES, count - first)};
        for (int k = 0; k < LANES; ++k)
            triangles.of[k] = of[min(first + k, count - 1)].triangle;
        set_up_planes(scene, &b->rays, &triangles, b->planes + first);
    }
    for (int k = 0; k < count && (TEXTURED || PHYSICAL); ++k)
        set_up_texture(scene, of[k].triangle, pixel, b->planes + k);
}

inline void sample_block(const Scene *scene, float pixel, Block *b)
{
    global Samples *out = b->samples;
    const Bundle *r = &b->rays;
    SampleRow s = {0};
    RowRegions list;
    set_up_regions(scene, pixel, b);
#if BAKED
    b->fitted = fit_regions(scene, &b->regions, r->half_extent, b->planes);
#endif
    list_regions(&b->regions, &list);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Row row = row_at(at, b->rays.half_extent);
        sample_row(scene, b, &list, at, row, &s);
        VSTORE(s.key, out->key + at);
        VSTORE(s.triangle, out->triangle + at);
        if (!row_any(GE(s.key, (vi)(0)))) continue;
        const Vec direction = direction_row(r, row);
        const Vec point = {fma(s.depth, direction.x, row_ox(r, row)),
                           fma(s.depth, direction.y, (vf)(row_oy(r, row))), s.depth};
        store3(point, out->point, at);
        if (SMOOTH) turn_to_viewer(direction, &s);
#if BAKED
        if (!b->fitted)
            *vectors_at(&s, BAKED_LIGHT) =
                baked_row(scene, s.of[PLACE], s.of[PLACE + 1], s.first, s.side);
#endif
        for (int k = 0; k < QUANTITIES; ++k) VSTORE(s.of[k], out->of[k] + at);
    }
}
