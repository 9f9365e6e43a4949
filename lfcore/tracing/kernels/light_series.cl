// Blocks of one element that lie on few triangles, lit triangle by triangle once it is known which rays see
// the lights that cast shadows.
//
// What a light gives a triangle, and where its texture is read, vary little over such a block: they are truncated series
// where what is cut off is below LIGHT_ERROR and TEXEL_ERROR, and computed ray by ray elsewhere (near lights, highlights
// narrower than the block, triangles that are seen from both sides).  A triangle that covers several blocks of a beam is
// set up once for all of them.
#ifndef LFCORE_LIGHT_SERIES_CL
#define LFCORE_LIGHT_SERIES_CL
#include "shares.cl"
#include "beam.cl"

#if OUTER == 1
// What series may cut off: of linear light, a light and colour (0 has every ray computed), and of a texel.
#ifndef LIGHT_ERROR
#define LIGHT_ERROR 3.0e-5f
#endif
#define TEXEL_ERROR 5.0e-4f
// What a light at most adds without changing a float of the size of these errors.
#define NEGLIGIBLE 1.0e-12f
// Highlights that may fall by more powers of e than this over a rectangle are computed ray by ray.
#define GLOSS_RANGE 4.0f

// What varies over a facet: cosines and highlights of the lights, both times their strength, and where its texture is read.
typedef struct {
    int lit, drawn;          // whether series of the lights, and of the coordinates, do
    int facing[LIGHTS + 1];  // how many rays' surface faces a light; of ALL_RAYS neither series is negative
    Quadratic cosine[LIGHTS + 1], gloss[LIGHTS + 1];
    int glossy[LIGHTS + 1];
    Quadratic across, down;  // turns of the texture, from
    float turn_u, turn_v;    // these whole ones
} FacetSeries;

// Values at the nodes.
typedef struct {
    float cosine[LIGHTS + 1][NODES], halfway[LIGHTS + 1][NODES], strength[LIGHTS + 1][NODES];
} LightNodes;

inline void light_nodes(const Surfaces *s, const Bundle *r, const Facet *f, const Rectangle *over, const Finish *finish, LightNodes *out)
{
    for (int at = 0; at < NODES; at += LANES) {
        const Places here = nodes_at(over, at);
        const vf z = form_nodes(f->over, here) * reciprocal(form_nodes(f->under, here));
        const Vec direction = {fma(here.x, (vf)(r->tx), (vf)(r->dx)), fma(here.y, (vf)(r->ty), (vf)(r->dy)), (vf)(1.0f)};
        const vf x = fma(here.x, (vf)(r->sx), (vf)(r->ox)), y = fma(here.y, (vf)(r->sy), (vf)(r->oy));
        const Vec point = {fma(z, direction.x, x), fma(z, direction.y, y), z};
        const Vec view = scale3(direction, -inverse_sqrt(dot3(direction, direction)));
#if SMOOTH
        const Vec n = {form_nodes(form_of(&f->of, NORMAL), here), form_nodes(form_of(&f->of, NORMAL + 1), here),
                       form_nodes(form_of(&f->of, NORMAL + 2), here)};
#else
        const Vec n = {f->normal.x, f->normal.y, f->normal.z};
#endif
        const Vec normal = viewed_normal(n, direction);
        for (int k = 0; k < LIGHTS; ++k) {
            const Incidence in = incidence(s->lights + k * LIGHT, is_glossy(finish), point, normal, view);
            VSTORE(in.cosine * in.strength, out->cosine[k] + at);
            VSTORE(in.halfway, out->halfway[k] + at);
            VSTORE(in.strength, out->strength[k] + at);
        }
    }
}

#if SMOOTH
// Whether normals stay on one side of the rays all over a rectangle: their product is a quadratic.
inline int normals_sided(const Facet *f, const Bundle *r, const Rectangle *over)
{
    const float3 ni = f->of.i.s012, nj = f->of.j.s012;
    const float3 n = f->of.c.s012 + over->x * ni + over->y * nj;
    const float3 d = {fma(over->x, r->tx, r->dx), fma(over->y, r->ty, r->dy), 1.0f};
    const float wide = over->wide, high = over->high;
    const float first = wide * fabs(inner_product(ni, d) + n.x * r->tx) + high * fabs(inner_product(nj, d) + n.y * r->ty);
    const float second = wide * wide * fabs(ni.x * r->tx) + high * high * fabs(nj.y * r->ty) +
                         wide * high * fabs(nj.x * r->tx + ni.y * r->ty);
    return fabs(inner_product(n, d)) > 1.00001f * (first + second) + 1.0e-6f * inner_product(fabs(n), fabs(d));
}
#endif

inline float largest(float3 c) { return max(c.x, max(c.y, c.z)); }
inline float light_strength(const Surfaces *s, int k) { return largest(vload3(0, s->lights + k * LIGHT + 4)); }

// The series of a light's highlight, if there is one on the rectangle; false where it varies too much.
inline int gloss_series(const Finish *finish, const LightNodes *nodes, const Rectangle *over, int k, float strength, FacetSeries *out)
{
    vf low = VLOAD(nodes->halfway[k]), high = low;
    for (int at = LANES; at < NODES; at += LANES) {
        low = min(low, VLOAD(nodes->halfway[k] + at));
        high = max(high, VLOAD(nodes->halfway[k] + at));
    }
    // Beyond the nodes a function that varies little gains less than what it varies between them.
    const float highest = row_max(high);
    if (2.0f * highest - row_min(low) < finish->dull) return 1;
    const Series halfway = make_series(nodes->halfway[k]);
    const float spread = series_spread(&halfway), most = halfway.row[0].x + spread, least = halfway.row[0].x - spread;
    out->glossy[k] = !(most < finish->dull);
    if (!out->glossy[k]) return 1;
    if (!(least > 0.0f && finish->shininess * (most - least) < GLOSS_RANGE * least)) return 0;
    private float values[NODES];
    for (int at = 0; at < NODES; at += LANES) {
        const Incidence in = {0.0f, VLOAD(nodes->halfway[k] + at), VLOAD(nodes->strength[k] + at)};
        VSTORE(gloss_of(finish, in), values + at);
    }
    const Series gloss = make_series(values);
    out->gloss[k] = truncate(&gloss, over);
    if (gloss.row[0].x < series_spread(&gloss)) out->facing[k] = SOME_RAYS;
    return series_rest(&gloss) * strength * largest(finish->specular) <= LIGHT_ERROR;
}

// What the lights that some ray sees give a facet over a rectangle; false where series would not do.
inline int light_series(const Surfaces *s, const Bundle *r, const Facet *f, const Rectangle *over, const Finish *finish, const int *seeing,
                        FacetSeries *out)
{
    if (!(LIGHT_ERROR > 0.0f)) return 0;
    const float most = max(largest(finish->diffuse), largest(finish->specular));
    int some = 0;
    for (int k = 0; k < LIGHTS; ++k) {
        const int hidden = k >= OPEN_LIGHTS && seeing[k - OPEN_LIGHTS] == NO_RAY;
        const int shines = !hidden && light_strength(s, k) * most >= NEGLIGIBLE;
        out->facing[k] = shines ? SOME_RAYS : NO_RAY;
        some |= shines;
    }
    if (!some) return 1;
#if SMOOTH
    if (!normals_sided(f, r, over)) return 0;
#endif
    LightNodes nodes;
    light_nodes(s, r, f, over, finish, &nodes);
    for (int k = 0; k < LIGHTS; ++k) {
        if (out->facing[k] == NO_RAY) continue;
        const float strength = light_strength(s, k);
        const Series cosine = make_series(nodes.cosine[k]);
        const float spread = series_spread(&cosine);
        out->facing[k] = cosine.row[0].x + spread < 0.0f ? NO_RAY : cosine.row[0].x < spread ? SOME_RAYS : ALL_RAYS;
        if (out->facing[k] == NO_RAY) continue;
        if (!(series_rest(&cosine) * strength * largest(finish->diffuse) <= LIGHT_ERROR)) return 0;
        out->cosine[k] = truncate(&cosine, over);
        out->glossy[k] = 0;
        if (is_glossy(finish) && !gloss_series(finish, &nodes, over, k, strength, out)) return 0;
    }
    return 1;
}

#if TEXTURED
// A quotient of two forms over a rectangle as a quadratic about its middle.  With the denominator s (1 + q) there, it is
// its middle value and (X x + Y y) / (1 + q), of which (X x + Y y) (1 - q) is kept.  Returns a bound of the rest.
inline float quotient_series(Form over, Form under, const Rectangle *at, Quadratic *out)
{
    const float inverse = 1.0f / fma(at->x, under.i, fma(at->y, under.j, under.c));
    const float a = under.i * inverse, b = under.j * inverse, middle = fma(at->x, over.i, fma(at->y, over.j, over.c)) * inverse;
    const float x = fma(-middle, under.i, over.i) * inverse, y = fma(-middle, under.j, over.j) * inverse;
    const Quadratic f = {middle, x, y, -a * x, -fma(a, y, b * x), -b * y};
    *out = f;
    const float q = fma(fabs(a), at->wide, fabs(b) * at->high);
    return q < 0.5f ? fma(fabs(x), at->wide, fabs(y) * at->high) * q * q / (1.0f - q) : FAR;
}

// The texture's coordinates over a rectangle; false where series would not do.
inline int texel_series(const Facet *f, const Rectangle *over, int4 image, FacetSeries *out)
{
    const float rest = quotient_series(form_of(&f->of, COORDINATES), f->sum, over, &out->across) * image.y +
                       quotient_series(form_of(&f->of, COORDINATES + 1), f->sum, over, &out->down) * image.z;
    out->turn_u = floor(out->across.c);
    out->turn_v = floor(out->down.c);
    out->across.c -= out->turn_u;
    out->down = scale_quadratic(out->down, -1.0f);
    out->down.c += out->turn_v;
    return rest <= TEXEL_ERROR;
}
#endif

// The series of a facet over a rectangle of bundle `r`, for which it was set up; `seeing`: how many of its rays see each
// light that casts shadows.
inline void facet_series(const Surfaces *s, const Bundle *r, const Facet *f, const Rectangle *over, const Finish *finish, const int *seeing,
                         FacetSeries *out)
{
    out->lit = light_series(s, r, f, over, finish, seeing, out);
    out->drawn = 0;
#if TEXTURED
    if (finish->image.y) out->drawn = texel_series(f, over, finish->image, out);
#endif
}

// Whether nothing need be computed ray by ray.
inline int is_smooth(const FacetSeries *series, const Finish *finish) { return series->lit && (series->drawn || !finish->image.y); }

// A triangle that covers blocks of a beam, set up for all blocks of one element.
typedef struct {
    int id, element;         // triangle, -1 if there is none
    int sided;               // whether all blocks see it from one side: else nothing here holds for all of them
    Facet facet;             // as seen from the middle of the element's blocks
    FacetSeries series;
} Cover;

inline Form shifted(Form f, float2 by)
{
    f.c = fma(by.x, f.i, fma(by.y, f.j, f.c));
    return f;
}

// Set up triangle `id`, which covers a block.
inline void make_cover(const Surfaces *s, const Rays *rays, const BeamWork *work, int block, int id, float pixel, Cover *cover)
{
    const Bundle r = element_bundle(rays, work, block);
    const Rectangle all = {0.0f, 0.0f, ELEMENT_HALF, ELEMENT_HALF};
    cover->id = id;
    cover->element = block / ELEMENT_BLOCKS;
    prepare_facet(s, &r, id, pixel, &cover->facet);
    cover->sided = one_sided_over(&cover->facet, all);
    if (!cover->sided) return;
    const Finish finish = read_finish(s, cover->facet.finish);
    int seeing[SHADOW_LIGHTS + 1];
    for (int k = 0; k < SHADOW_LIGHTS; ++k) seeing[k] = SOME_RAYS;
    facet_series(s, &r, &cover->facet, &all, &finish, seeing, &cover->series);
}

// A cover's facet as seen from the middle of a block, `offset` away.
inline void shift_facet(const Surfaces *s, const Cover *cover, float2 offset, float pixel, Facet *facet)
{
    const Facet *from = &cover->facet;
    facet->sum = shifted(from->sum, offset);
    facet->over = shifted(from->over, offset);
    facet->under = shifted(from->under, offset);
    facet->finish = from->finish;
#if SMOOTH || TEXTURED || VERTEX_COLOURS
    facet->of = from->of;
    facet->of.c = fma((float8)(offset.x), from->of.i, fma((float8)(offset.y), from->of.j, from->of.c));
#endif
#if !SMOOTH
    facet->normal = from->normal;
#endif
#if TEXTURED
    facet->finish = choose_finish(s, cover->id, facet, facet->over.c / facet->under.c, pixel);
#endif
#if VERTEX_COLOURS
    facet->first = from->first;
#endif
}

// Triangle `id`, which covers a block, set up for it.  Returns whether the cover's series hold there.
inline int cover_block(const Surfaces *s, const Rays *rays, const BeamWork *work, int block, const Bundle *r, int id, float pixel,
                       Cover *cover, Facet *facet)
{
    if (cover->id != id || cover->element != block / ELEMENT_BLOCKS) make_cover(s, rays, work, block, id, pixel, cover);
    if (cover->sided) shift_facet(s, cover, block_offset(block), pixel, facet);
    else prepare_facet(s, r, id, pixel, facet);
    return cover->sided;
}
#endif

#endif
