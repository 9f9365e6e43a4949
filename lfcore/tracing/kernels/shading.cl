// Blinn-Phong for a block, one triangle at a time.
//
// What a triangle interpolates is a quotient of affine forms over the block, so a triangle is set up
// once and each row of rays costs a few fused multiply-adds.  Lights that cast shadows write what they
// would add to buffers of their own, for shadows.cl to take back.
//
// Compiled in only where the scene needs it: SMOOTH (interpolated normals), TEXTURED, VERTEX_COLOURS,
// SPECULAR, EMISSION, AMBIENT, BACKGROUND; OPEN_LIGHTS and SHADOW_LIGHTS count the lights without and with
// shadows; POINT_LIGHTS and DIRECTIONAL_LIGHTS: some light is of that kind, FALLOFF: some falls off with
// distance, COLOURED_LIGHTS: some is not grey, EMITTERS: some is a point of a surface that glows.
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

// A texture's colour, times the vertex colours; `patch`, if there is one, holds the texels.
inline Colour texel(const Surfaces *s, const Finish *f, const Surface *p, const Patch *patch)
{
    Colour c = {1.0f, 1.0f, 1.0f};
#if TEXTURED
    if (f->image.y) c = patch && patch->columns ? sample_patch(patch, p->u, p->v) : sample_texture(s->texels, f->image, p->u, p->v);
#endif
#if VERTEX_COLOURS
    c.r *= p->rgb.r; c.g *= p->rgb.g; c.b *= p->rgb.b;
#endif
    return c;
}

// The same, times the material's colour.
inline Colour albedo(const Surfaces *s, const Finish *f, const Surface *p, const Patch *patch)
{
    const Colour t = texel(s, f, p, patch);
    const Colour c = {t.r * f->diffuse.x, t.g * f->diffuse.y, t.b * f->diffuse.z};
    return c;
}

inline void store_row(global float *planes, int at, Colour c)
{
    VSTORE(c.r, planes + at);
    VSTORE(c.g, planes + BLOCK_RAYS + at);
    VSTORE(c.b, planes + 2 * BLOCK_RAYS + at);
}

inline Colour pick_colour(Colour a, Colour b, vi mask)
{
    Colour c = {pick(a.r, b.r, mask), pick(a.g, b.g, mask), pick(a.b, b.b, mask)};
    return c;
}

// How a light meets a row of rays: cosines with the normal, and of the normal with halfway to the viewer (0 unless
// `gloss` is wanted), and what distance leaves of its strength.
typedef struct { vf cosine, halfway, strength; } Incidence;

inline Incidence incidence(global const float *light, int gloss, Vec point, Vec normal, Vec view)
{
    Incidence in = {0.0f, 0.0f, 1.0f};
    Vec l = {light[0], light[1], light[2]};
    if (IS_POINT(light)) {
        l.x -= point.x; l.y -= point.y; l.z -= point.z;
        const vf inverse = inverse_sqrt(dot3(l, l));
        l = scale3(l, inverse);
#if FALLOFF
        if (light[7] > 0.0f) in.strength = light[7] * inverse * (light[7] * inverse);
#endif
#if EMITTERS
        const float3 n = vload3(0, light + LIGHT_NORMAL);
        if (any(n != 0.0f)) in.strength *= max(-fma(l.x, (vf)(n.x), fma(l.y, (vf)(n.y), l.z * n.z)), (vf)(0.0f));
#endif
    }
    in.cosine = dot3(normal, l);
    if (gloss) {
        const Vec h = {l.x + view.x, l.y + view.y, l.z + view.z};
        in.halfway = dot3(normal, h) * inverse_sqrt(max(dot3(h, h), (vf)(1.0e-30f)));
    }
    return in;
}

inline int is_glossy(const Finish *f) { return SPECULAR && f->specular.x + f->specular.y + f->specular.z > 0.0f; }

inline vf gloss_of(const Finish *f, Incidence in)
{
    return exp2_fast(f->shininess * log2_fast(max(in.halfway, (vf)(1.0e-30f)))) * in.strength;
}

// What one light adds to a row of rays; `facing` receives the rays that it can reach.
inline Colour light_row(global const float *light, const Finish *f, Colour albedo, Vec point, Vec normal, Vec view, vi *facing)
{
    const Incidence in = incidence(light, is_glossy(f), point, normal, view);
    *facing = GT(in.cosine, (vf)(0.0f));
    const vf diffuse = max(in.cosine, (vf)(0.0f)) * in.strength;
    Colour c = {albedo.r * diffuse, albedo.g * diffuse, albedo.b * diffuse};
    if (is_glossy(f)) {
        const vi glossy = *facing & GE(in.halfway, (vf)(f->dull));
        if (row_any(glossy)) {
            const vf gloss = pick((vf)(0.0f), gloss_of(f, in), glossy);
            c.r = fma(gloss, (vf)(f->specular.x), c.r);
            c.g = fma(gloss, (vf)(f->specular.y), c.g);
            c.b = fma(gloss, (vf)(f->specular.z), c.b);
        }
    }
#if COLOURED_LIGHTS
    c.r *= light[4]; c.g *= light[5]; c.b *= light[6];
#else
    const float grey = light[4];
    c.r *= grey; c.g *= grey; c.b *= grey;
#endif
    return c;
}

// Where a row of rays meets its surfaces.
typedef struct {
    Vec point, view, normal;
} Meeting;

inline Meeting make_meeting(const Surface *p, const Bundle *r, Row row, vf z)
{
    Meeting m;
    const Vec direction = {row_dx(r, row), (vf)(row_dy(r, row)), (vf)(1.0f)};
    m.point.x = fma(z, direction.x, row_ox(r, row));
    m.point.y = fma(z, direction.y, (vf)(row_oy(r, row)));
    m.point.z = z;
    m.view = scale3(direction, -inverse_sqrt(dot3(direction, direction)));
    m.normal = viewed_normal(p->normal, direction);
    return m;
}

// What a surface of one finish sends back without the lights that cast shadows.
inline Colour unshadowed(const Surfaces *s, const Finish *f, Colour colour, const Meeting *m)
{
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
        const Colour c = light_row(s->lights + k * LIGHT, f, colour, m->point, m->normal, m->view, &facing);
        base.r += c.r; base.g += c.g; base.b += c.b;
    }
    return base;
}

inline Colour background_colour(const Surfaces *s)
{
#if BACKGROUND
    Colour c = {s->background.x, s->background.y, s->background.z};
#else
    Colour c = {0.0f, 0.0f, 0.0f};
#endif
    return c;
}

// All rays of a block that meet nothing.
inline void shade_nothing(const Surfaces *s, const BlockColours *out)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES) store_row(out->base, at, background_colour(s));
}

// Facets of a block, kept from row to row: a triangle has a slot by its number, and another one.
#define SLOTS 32
#define SEEN 1024
typedef struct {
    Facet facet[SLOTS];
    int id[SLOTS];           // -1: empty
    uint seen[SEEN / 32];    // a bit for each triangle, modulo SEEN
    int count;               // bits set, whatever order the rows are read in: the triangles, but for some of very many
    int lost;                // some found both their slots taken
} Facets;

inline void clear_facets(Facets *facets)
{
    for (int k = 0; k < SLOTS; ++k) facets->id[k] = -1;
    for (int k = 0; k < SEEN / 32; ++k) facets->seen[k] = 0;
    facets->count = facets->lost = 0;
}

inline const Facet *find_facet(const Surfaces *s, const Bundle *r, int id, float pixel, Facets *facets)
{
    int slot = id % SLOTS;
    const int other = slot ^ SLOTS / 2;
    if (facets->id[slot] == id) return facets->facet + slot;
    if (facets->id[other] == id) return facets->facet + other;
    if (facets->id[slot] >= 0) {
        if (facets->id[other] < 0) slot = other;
        else facets->lost = 1;
    }
    facets->id[slot] = id;
    prepare_facet(s, r, id, pixel, facets->facet + slot);
    uint *word = facets->seen + id % SEEN / 32;
    facets->count += !(*word >> id % 32 & 1);
    *word |= 1u << id % 32;
    return facets->facet + slot;
}

// Interpolate a row of rays that meet some triangle each or, in some lanes, none.  Returns what each
// ray's surface is made of, -1 where it meets nothing.
inline vi interpolate_row(const Surfaces *s, const Bundle *r, global const int *ids, Row at, float pixel, Facets *facets, Surface *p)
{
    const vi row = VLOAD(ids);
    uint todo = row_bits(GE(row, (vi)(0)));
    vi made_of = -1;
    for (int first = 1; todo; first = 0) {
        const int id = ids[lowest(todo)];
        const Facet *f = find_facet(s, r, id, pixel, facets);
        const vi mask = EQ(row, (vi)(id));
        todo &= ~row_bits(mask);
        const Surface q = interpolate(f, at);
        *p = first ? q : pick_surface(*p, q, mask);
        made_of = pick_int(made_of, (vi)(f->finish), mask);
    }
    return made_of;
}

// Shade a row of a block of several triangles, finish by finish; `number` and `finish` are the last one read.
inline void shade_row(const Surfaces *s, const Surface *p, const Meeting *m, vi made_of, int at, const BlockColours *out, int *number,
                      Finish *finish)
{
    private int numbers[LANES];
    VSTORE(made_of, numbers);
    Colour base = background_colour(s), lit[SHADOW_LIGHTS + 1];
    vi wants[SHADOW_LIGHTS + 1];
    for (int k = 0; k < SHADOW_LIGHTS; ++k) { lit[k].r = 0.0f; lit[k].g = 0.0f; lit[k].b = 0.0f; wants[k] = 0; }
    for (uint todo = row_bits(GE(made_of, (vi)(0))); todo;) {
        const int next = numbers[lowest(todo)];
        const vi mask = EQ(made_of, (vi)(next));
        todo &= ~row_bits(mask);
        if (next != *number) {
            *number = next;
            *finish = read_finish(s, next);
        }
        const Colour colour = albedo(s, finish, p, 0);
        base = pick_colour(base, unshadowed(s, finish, colour, m), mask);
        for (int k = 0; k < SHADOW_LIGHTS; ++k) {
            vi facing;
            const Colour c = light_row(s->lights + (OPEN_LIGHTS + k) * LIGHT, finish, colour, m->point, m->normal, m->view, &facing);
            lit[k] = pick_colour(lit[k], c, mask);
            wants[k] |= facing & mask;
        }
    }
    store_row(out->base, at, base);
    for (int k = 0; k < SHADOW_LIGHTS; ++k) {
        store_row(out->lit + k * 3 * BLOCK_RAYS, at, lit[k]);
        VSTORE(wants[k], out->wants + k * BLOCK_RAYS + at);
    }
}

// Shade a block from its buffers; `facets` receives the triangles that it sees.
inline void shade_block(const Surfaces *s, const Bundle *r, global const float *z, global const int *ids, float pixel, Facets *facets,
                        const BlockColours *out)
{
    clear_facets(facets);
    int number = -1;
    Finish finish;
    Surface p = {0};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Row row = row_at(at);
        const vi made_of = interpolate_row(s, r, ids + at, row, pixel, facets, &p);
        const Meeting m = make_meeting(&p, r, row, VLOAD(z + at));
#if SHADOW_LIGHTS
        const Colour where = {m.point.x, m.point.y, m.point.z};
        store_row(out->point, at, where);
#endif
        shade_row(s, &p, &m, made_of, at, out, &number, &finish);
    }
}

#endif
