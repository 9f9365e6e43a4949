// Blinn-Phong for a block, one triangle at a time.
//
// What a triangle interpolates is a quotient of affine forms over the block, so a triangle is set up
// once and each row of rays costs a few fused multiply-adds.  Lights that cast shadows write what they
// would add to buffers of their own, for shadows.cl to take back.
//
// Compiled in only where the scene needs it: SMOOTH (interpolated normals), TEXTURED, VERTEX_COLOURS,
// SPECULAR, EMISSION, AMBIENT, BACKGROUND; OPEN_LIGHTS and SHADOW_LIGHTS count the lights without and with
// shadows; POINT_LIGHTS and DIRECTIONAL_LIGHTS: some light is of that kind, FALLOFF: some falls off with
// distance, COLOURED_LIGHTS: some is not grey.
#ifndef LFCORE_SHADING_CL
#define LFCORE_SHADING_CL
#include "facets.cl"

// A block's colours while they are made: (n, BLOCK_RAYS) each.
typedef struct {
    global float *base;     // (3, ...) ambient, emission, lights without shadows
    global float *point;    // (3, ...) where the ray met the surface
    global float *lit;      // (SHADOW_LIGHTS, 3, ...) what each light adds if nothing is in between
    global int *wants;      // (SHADOW_LIGHTS, ...) mask: rays that the light may reach
} BlockColours;

inline Vec viewed_normal(Vec n, Vec direction)
{
#if SMOOTH
    n = scale3(n, inverse_sqrt(max(dot3(n, n), (vf)(1.0e-37f))));
    const vi away = GT(dot3(n, direction), (vf)(0.0f)) & (vi)(0x80000000);
    FLIP_BY(n.x, away); FLIP_BY(n.y, away); FLIP_BY(n.z, away);
#endif
    return n;
}

inline Colour albedo(const Surfaces *s, const Finish *f, const Surface *p)
{
    Colour c = {f->diffuse.x, f->diffuse.y, f->diffuse.z};
#if TEXTURED
    if (f->image.y) {
        const Colour t = sample_texture(s->texels, f->image, p->u, p->v);
        c.r *= t.r; c.g *= t.g; c.b *= t.b;
    }
#endif
#if VERTEX_COLOURS
    c.r *= p->rgb.r; c.g *= p->rgb.g; c.b *= p->rgb.b;
#endif
    return c;
}

inline void store_row(global float *planes, int at, Colour c, vi mask)
{
    VSTORE(pick(VLOAD(planes + at), c.r, mask), planes + at);
    VSTORE(pick(VLOAD(planes + BLOCK_RAYS + at), c.g, mask), planes + BLOCK_RAYS + at);
    VSTORE(pick(VLOAD(planes + 2 * BLOCK_RAYS + at), c.b, mask), planes + 2 * BLOCK_RAYS + at);
}

// What one light adds to a row of rays; `facing` receives the rays that it can reach.
inline Colour light_row(global const float *light, const Finish *f, Colour albedo, Vec point, Vec normal, Vec view, vi *facing)
{
    Vec l = {light[0], light[1], light[2]};
    vf strength = 1.0f;
    if (IS_POINT(light)) {
        l.x -= point.x; l.y -= point.y; l.z -= point.z;
        const vf inverse = inverse_sqrt(dot3(l, l));
        l = scale3(l, inverse);
#if FALLOFF
        if (light[7] > 0.0f) strength = light[7] * inverse * (light[7] * inverse);
#endif
    }
    const vf cosine = dot3(normal, l);
    *facing = GT(cosine, (vf)(0.0f));
    vf diffuse = max(cosine, (vf)(0.0f)) * strength;
    Colour c = {albedo.r * diffuse, albedo.g * diffuse, albedo.b * diffuse};
#if SPECULAR
    if (f->specular.x + f->specular.y + f->specular.z > 0.0f) {
        const Vec h = {l.x + view.x, l.y + view.y, l.z + view.z};
        const vf halfway = max(dot3(normal, h), (vf)(0.0f)) * inverse_sqrt(max(dot3(h, h), (vf)(1.0e-30f)));
        vf gloss = exp2_fast(f->shininess * log2_fast(max(halfway, (vf)(1.0e-30f)))) * strength;
        gloss = pick((vf)(0.0f), gloss, *facing);
        c.r = fma(gloss, (vf)(f->specular.x), c.r);
        c.g = fma(gloss, (vf)(f->specular.y), c.g);
        c.b = fma(gloss, (vf)(f->specular.z), c.b);
    }
#endif
#if COLOURED_LIGHTS
    c.r *= light[4]; c.g *= light[5]; c.b *= light[6];
#else
    const float grey = light[4];
    c.r *= grey; c.g *= grey; c.b *= grey;
#endif
    return c;
}

inline void shade_row(const Surfaces *s, const Finish *f, const Surface *p, const Bundle *r, vf z, vi mask, int at, const BlockColours *out)
{
    const Row row = row_at(at);
    const Vec direction = {row_dx(r, row), (vf)(row_dy(r, row)), (vf)(1.0f)};
    const Vec point = {fma(z, direction.x, row_ox(r, row)), fma(z, direction.y, (vf)(row_oy(r, row))), z};
    const Vec view = scale3(direction, -inverse_sqrt(dot3(direction, direction)));
    const Vec normal = viewed_normal(p->normal, direction);
    const Colour colour = albedo(s, f, p);
#if AMBIENT
    Colour base = {colour.r * s->ambient.x, colour.g * s->ambient.y, colour.b * s->ambient.z};
#else
    Colour base = {0.0f, 0.0f, 0.0f};
#endif
#if EMISSION
    base.r += f->emission.x; base.g += f->emission.y; base.b += f->emission.z;
#endif
    vi facing;
    for (int k = 0; k < OPEN_LIGHTS; ++k) {
        const Colour c = light_row(s->lights + k * LIGHT, f, colour, point, normal, view, &facing);
        base.r += c.r; base.g += c.g; base.b += c.b;
    }
    store_row(out->base, at, base, mask);
#if SHADOW_LIGHTS
    const Colour where = {point.x, point.y, point.z};
    store_row(out->point, at, where, mask);
    for (int k = 0; k < SHADOW_LIGHTS; ++k) {
        const Colour c = light_row(s->lights + (OPEN_LIGHTS + k) * LIGHT, f, colour, point, normal, view, &facing);
        store_row(out->lit + k * 3 * BLOCK_RAYS, at, c, mask);
        global int *wants = out->wants + k * BLOCK_RAYS + at;
        VSTORE(pick_int(VLOAD(wants), facing, mask), wants);
    }
#endif
}

inline void clear_block(const Surfaces *s, const BlockColours *out)
{
#if BACKGROUND
    const Colour background = {s->background.x, s->background.y, s->background.z};
#else
    const Colour background = {0.0f, 0.0f, 0.0f};
#endif
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        store_row(out->base, at, background, (vi)(-1));
        for (int k = 0; k < SHADOW_LIGHTS; ++k) VSTORE((vi)(0), out->wants + k * BLOCK_RAYS + at);
    }
}

// Surfaces of a block of several triangles, interpolated triangle by triangle, to be lit row by row.
#define SURFACE_PLANES (3 + 2 * TEXTURED + 3 * VERTEX_COLOURS)

inline void put_row(global float *plane, int at, vf value, vi mask)
{
    VSTORE(pick(VLOAD(plane + at), value, mask), plane + at);
}

inline void put_surface(global float *planes, int at, const Surface *p, vi mask)
{
    put_row(planes, at, p->normal.x, mask);
    put_row(planes + BLOCK_RAYS, at, p->normal.y, mask);
    put_row(planes + 2 * BLOCK_RAYS, at, p->normal.z, mask);
#if TEXTURED
    put_row(planes + 3 * BLOCK_RAYS, at, p->u, mask);
    put_row(planes + 4 * BLOCK_RAYS, at, p->v, mask);
#endif
#if VERTEX_COLOURS
    planes += (3 + 2 * TEXTURED) * BLOCK_RAYS;
    put_row(planes, at, p->rgb.r, mask);
    put_row(planes + BLOCK_RAYS, at, p->rgb.g, mask);
    put_row(planes + 2 * BLOCK_RAYS, at, p->rgb.b, mask);
#endif
}

inline Surface get_surface(global const float *planes, int at)
{
    Surface p;
    p.normal.x = VLOAD(planes + at); p.normal.y = VLOAD(planes + BLOCK_RAYS + at); p.normal.z = VLOAD(planes + 2 * BLOCK_RAYS + at);
#if TEXTURED
    p.u = VLOAD(planes + 3 * BLOCK_RAYS + at);
    p.v = VLOAD(planes + 4 * BLOCK_RAYS + at);
#endif
#if VERTEX_COLOURS
    planes += (3 + 2 * TEXTURED) * BLOCK_RAYS;
    p.rgb.r = VLOAD(planes + at); p.rgb.g = VLOAD(planes + BLOCK_RAYS + at); p.rgb.b = VLOAD(planes + 2 * BLOCK_RAYS + at);
#endif
    return p;
}

// End of the rows that are looked through for a triangle of row `first`: scattered rays seldom share one.
#define SAME_TRIANGLE(first) (SCATTERED ? (first) + 1 : BLOCK_RAYS / LANES)

// Interpolate every triangle of a block; `finishes` receives what each ray's surface is made of, -1
// where it meets nothing.  Returns how many triangles there were.
inline int interpolate_block(const Surfaces *s, const Bundle *r, global const int *ids, float pixel, global float *surfaces,
                              global int *finishes)
{
    Facet f;
    int count = 0;
    private uint todo[BLOCK_RAYS / LANES];
    for (int k = 0; k < BLOCK_RAYS / LANES; ++k) {
        todo[k] = row_bits(GE(VLOAD(ids + k * LANES), (vi)(0)));
        VSTORE((vi)(-1), finishes + k * LANES);
    }
    for (int first = 0; first < BLOCK_RAYS / LANES; ++first)
        while (todo[first]) {
            const int id = ids[first * LANES + lowest(todo[first])];
            prepare_facet(s, r, id, pixel, &f);
            ++count;
            for (int k = first; k < SAME_TRIANGLE(first); ++k) {
                if (!todo[k]) continue;
                const int at = k * LANES;
                const vi mask = EQ(VLOAD(ids + at), (vi)(id));
                const uint bits = row_bits(mask);
                if (!bits) continue;
                todo[k] &= ~bits;
                const Surface p = interpolate(&f, row_at(at));
                put_surface(surfaces, at, &p, mask);
                VSTORE(pick_int(VLOAD(finishes + at), (vi)(f.finish), mask), finishes + at);
            }
        }
    return count;
}

// Shade a block from its state: wholly on one triangle, or from its buffers.  `surfaces` and
// `finishes` are scratch.  Returns the number of triangles that the block sees.
inline int shade_block(const Surfaces *s, const Bundle *r, const BlockState *state, global const float *z, global const int *ids,
                        float pixel, global float *surfaces, global int *finishes, const BlockColours *out)
{
    if (state->cover >= 0) {
        Facet f;
        prepare_facet(s, r, state->cover, pixel, &f);
        const Finish finish = read_finish(s, f.finish);
        for (int at = 0; at < BLOCK_RAYS; at += LANES) {
            const Row row = row_at(at);
            const Surface p = interpolate(&f, row);
            shade_row(s, &finish, &p, r, cover_depth(state, row), (vi)(-1), at, out);
        }
        return 1;
    }
    clear_block(s, out);
    if (state->cover == NOTHING) return 0;
    const int count = interpolate_block(s, r, ids, pixel, surfaces, finishes);
    int number = -1;
    Finish finish;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi made_of = VLOAD(finishes + at);
        const Surface p = get_surface(surfaces, at);
        for (uint todo = row_bits(GE(made_of, (vi)(0))); todo;) {
            const int next = finishes[at + lowest(todo)];
            const vi mask = EQ(made_of, (vi)(next));
            todo &= ~row_bits(mask);
            if (next != number) {
                number = next;
                finish = read_finish(s, number);
            }
            shade_row(s, &finish, &p, r, VLOAD(z + at), mask, at, out);
        }
    }
    return count;
}

#endif
