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
// Highlights that fall by more powers of two than this over a rectangle are computed ray by ray.
#define GLOSS_RANGE 6.0f

// What varies over a facet: cosines and highlights of the lights, both times their strength, and where its texture is read.
typedef struct {
    int lit, drawn;          // whether series of the lights, and of the coordinates, do
    Quadratic cosine[LIGHTS + 1], gloss[LIGHTS + 1];
    int glossy[LIGHTS + 1];
    Quadratic across, down;  // turns of the texture, from
    float turn_u, turn_v;    // these whole ones
} FacetSeries;

// Values at the nodes.
typedef struct {
    float side[NODES];       // normal times direction
    float cosine[LIGHTS + 1][NODES], halfway[LIGHTS + 1][NODES], gloss[LIGHTS + 1][NODES];
} LightNodes;

inline void light_nodes(const Surfaces *s, const Bundle *r, const Facet *f, const Rectangle *over, const Finish *finish, LightNodes *out)
{
    for (int at = 0; at < NODES; at += LANES) {
        const Places here = nodes_at(over, at);
        const vf z = form_nodes(f->over, here) * reciprocal(form_nodes(f->under, here));
        const Vec direction = {fma(here.x, (vf)(r->tx), (vf)(r->dx)), fma(here.y, (vf)(r->ty), (vf)(r->dy)), (vf)(1.0f)};
        const Vec point = {fma(z, direction.x, fma(here.x, (vf)(r->sx), (vf)(r->ox))), fma(z, direction.y, fma(here.y, (vf)(r->sy), (vf)(r->oy))), z};
        const Vec view = scale3(direction, -inverse_sqrt(dot3(direction, direction)));
#if SMOOTH
        const Vec n = {form_nodes(f->n[0], here), form_nodes(f->n[1], here), form_nodes(f->n[2], here)};
#else
        const Vec n = {f->normal.x, f->normal.y, f->normal.z};
#endif
        VSTORE(dot3(n, direction), out->side + at);
        const Vec normal = viewed_normal(n, direction);
        for (int k = 0; k < LIGHTS; ++k) {
            const Incidence in = incidence(s->lights + k * LIGHT, is_glossy(finish), point, normal, view);
            VSTORE(in.cosine * in.strength, out->cosine[k] + at);
            VSTORE(in.halfway, out->halfway[k] + at);
            if (is_glossy(finish)) VSTORE(gloss_of(finish, in), out->gloss[k] + at);
        }
    }
}

inline float largest(float3 c) { return max(c.x, max(c.y, c.z)); }

// The series of a light's highlight, if there is one on the rectangle; false where it varies too much.
inline int gloss_series(const Finish *finish, const LightNodes *nodes, const Rectangle *over, int k, float strength, FacetSeries *out)
{
    const Series halfway = make_series(nodes->halfway[k]);
    const float spread = series_spread(&halfway), most = halfway.row[0].x + spread, least = halfway.row[0].x - spread;
    out->glossy[k] = !(most < finish->dull);
    if (!out->glossy[k]) return 1;
    if (!(least > 0.0f && finish->shininess * native_log2(most / least) < GLOSS_RANGE)) return 0;
    const Series gloss = make_series(nodes->gloss[k]);
    out->gloss[k] = truncate(&gloss, over);
    return series_rest(&gloss) * strength * largest(finish->specular) <= LIGHT_ERROR;
}

// What the lights give a facet over a rectangle; false where series would not do.
inline int light_series(const Surfaces *s, const Bundle *r, const Facet *f, const Rectangle *over, const Finish *finish, FacetSeries *out)
{
    if (!(LIGHT_ERROR > 0.0f)) return 0;
    LightNodes nodes;
    light_nodes(s, r, f, over, finish, &nodes);
#if SMOOTH
    const Series side = make_series(nodes.side);  // quadratic: exact
    if (!(fabs(side.row[0].x) > series_spread(&side))) return 0;
#endif
    for (int k = 0; k < LIGHTS; ++k) {
        const float strength = largest(vload3(0, s->lights + k * LIGHT + 4));
        const Series cosine = make_series(nodes.cosine[k]);
        const int faint = strength * max(largest(finish->diffuse), largest(finish->specular)) < NEGLIGIBLE;
        if (faint || cosine.row[0].x + series_spread(&cosine) < 0.0f) {
            const Quadratic none = {-1.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
            out->cosine[k] = none;
            out->glossy[k] = 0;
            continue;
        }
        if (!(series_rest(&cosine) * strength * largest(finish->diffuse) <= LIGHT_ERROR)) return 0;
        out->cosine[k] = truncate(&cosine, over);
        out->glossy[k] = 0;
        if (is_glossy(finish) && !gloss_series(finish, &nodes, over, k, strength, out)) return 0;
    }
    return 1;
}

#if TEXTURED
// The texture's coordinates over a rectangle; false where series would not do.
inline int texel_series(const Facet *f, const Rectangle *over, int4 image, FacetSeries *out)
{
    private float u[NODES], v[NODES];
    out->turn_u = floor(f->uv[0].c / f->sum.c);
    out->turn_v = floor(f->uv[1].c / f->sum.c);
    for (int at = 0; at < NODES; at += LANES) {
        const Places here = nodes_at(over, at);
        const vf inverse = reciprocal(form_nodes(f->sum, here));
        VSTORE(fma(form_nodes(f->uv[0], here), inverse, (vf)(-out->turn_u)), u + at);
        VSTORE(fma(-form_nodes(f->uv[1], here), inverse, (vf)(out->turn_v)), v + at);
    }
    const Series across = make_series(u), down = make_series(v);
    out->across = truncate(&across, over);
    out->down = truncate(&down, over);
    return series_rest(&across) * image.y + series_rest(&down) * image.z <= TEXEL_ERROR;
}
#endif

// The series of a facet over a rectangle of bundle `r`, for which it was set up.
inline void facet_series(const Surfaces *s, const Bundle *r, const Facet *f, const Rectangle *over, const Finish *finish, FacetSeries *out)
{
    out->lit = light_series(s, r, f, over, finish, out);
    out->drawn = 0;
#if TEXTURED
    if (finish->image.y) out->drawn = texel_series(f, over, finish->image, out);
#endif
}

// Whether nothing need be computed ray by ray.
inline int is_smooth(const FacetSeries *series, const Finish *finish) { return series->lit && (series->drawn || !finish->image.y); }

// A facet while its rays in a block are lit.
typedef struct {
    const Share *share;
    Finish finish;
    const FacetSeries *series;
    float2 offset;           // of the block's middle from where the series are counted
    Patch patch;
    int patched;             // whether texels come from the patch, at
    Quadratic x, y;          // these places
} Painting;

// The series along a row of a block.
typedef struct {
    Parabola cosine[LIGHTS + 1], gloss[LIGHTS + 1], x, y;
} PaintedRow;

inline void start_row(const Painting *p, float y, PaintedRow *row)
{
    for (int k = 0; k < LIGHTS; ++k) {
        row->cosine[k] = along_row(p->series->cosine[k], y);
        row->gloss[k] = along_row(p->series->gloss[k], y);
    }
    row->x = along_row(p->x, y);
    row->y = along_row(p->y, y);
}

// The material's colour with its texture and vertex colours.
inline Colour row_albedo(const Surfaces *s, const Painting *p, const PaintedRow *row, Row at, vf x)
{
#if TEXTURED
    if (p->patched) {
        const Colour t = mix_patch(&p->patch, parabola(row->x, x), parabola(row->y, x));
        Colour c = {t.r * p->finish.diffuse.x, t.g * p->finish.diffuse.y, t.b * p->finish.diffuse.z};
#if VERTEX_COLOURS
        const Surface surface = interpolate(p->share->facet, at);
        c.r *= surface.rgb.r; c.g *= surface.rgb.g; c.b *= surface.rgb.b;
#endif
        return c;
    }
#endif
    const Surface surface = interpolate(p->share->facet, at);
    return albedo(s, &p->finish, &surface, &p->patch);
}

// Colours from the series, of rays at places x of a row; `wants` are those that see each light that casts shadows.
inline Colour series_row(const Surfaces *s, const Painting *p, const PaintedRow *row, Colour albedo, vf x, global const int *wants)
{
    Colour light = {0.0f, 0.0f, 0.0f}, shine = {0.0f, 0.0f, 0.0f};
#if AMBIENT
    light.r = s->ambient.x; light.g = s->ambient.y; light.b = s->ambient.z;
#endif
#if EMISSION
    shine.r = p->finish.emission.x; shine.g = p->finish.emission.y; shine.b = p->finish.emission.z;
#endif
    for (int k = 0; k < LIGHTS; ++k) {
        const float3 c = vload3(0, s->lights + k * LIGHT + 4);
        vf diffuse = max(parabola(row->cosine[k], x), (vf)(0.0f));
        vi open = GT(diffuse, (vf)(0.0f));
        if (k >= OPEN_LIGHTS) open &= VLOAD(wants + (k - OPEN_LIGHTS) * BLOCK_RAYS);
        diffuse = AS_VF(AS_VI(diffuse) & open);
        light.r = fma(diffuse, (vf)(c.x), light.r); light.g = fma(diffuse, (vf)(c.y), light.g); light.b = fma(diffuse, (vf)(c.z), light.b);
        if (!p->series->glossy[k]) continue;
        const vf gloss = AS_VF(AS_VI(max(parabola(row->gloss[k], x), (vf)(0.0f))) & open);
        const float3 back = c * p->finish.specular;
        shine.r = fma(gloss, (vf)(back.x), shine.r); shine.g = fma(gloss, (vf)(back.y), shine.g); shine.b = fma(gloss, (vf)(back.z), shine.b);
    }
    const Colour sum = {fma(albedo.r, light.r, shine.r), fma(albedo.g, light.g, shine.g), fma(albedo.b, light.b, shine.b)};
    return sum;
}

// The same without series.
inline Colour exact_row(const Surfaces *s, const Bundle *r, const Painting *p, Colour albedo, Row row, global const int *wants)
{
    const Surface surface = interpolate(p->share->facet, row);
    const Meeting m = make_meeting(&surface, r, row, quotient_row(p->share->facet->over, p->share->facet->under, row));
    Colour sum = unshadowed(s, &p->finish, albedo, &m);
    for (int k = 0; k < SHADOW_LIGHTS; ++k) {
        const vi open = VLOAD(wants + k * BLOCK_RAYS);
        if (!row_any(open)) continue;
        vi facing;
        const Colour c = light_row(s->lights + (OPEN_LIGHTS + k) * LIGHT, &p->finish, albedo, m.point, m.normal, m.view, &facing);
        sum.r += pick((vf)(0.0f), c.r, open); sum.g += pick((vf)(0.0f), c.g, open); sum.b += pick((vf)(0.0f), c.b, open);
    }
    return sum;
}

#if TEXTURED
// Read the texels under the share, and count the series of coordinates from there.
inline void start_patch(const Surfaces *s, Painting *p)
{
    Patch *patch = &p->patch;
    const FacetSeries *series = p->series;
    patch->columns = 0;
    if (p->finish.image.y) facet_patch(s, p->share->facet, &p->share->over, p->finish.image, patch);
    p->patched = series->drawn && patch->columns;
    if (!p->patched) return;
    p->x = scale_quadratic(series->across, patch->width);
    p->y = scale_quadratic(series->down, patch->height);
    p->x.c -= fma(patch->u - series->turn_u, patch->width, patch->left + 0.5f);
    p->y.c += fma(1.0f + patch->v - series->turn_v, patch->height, -(patch->top + 0.5f));
}
#endif

// Colours of a share's rays: all of its rectangle if there are no `ids`.
inline void paint_share(const Surfaces *s, const Bundle *r, Painting *p, global const int *ids, const BlockColours *out)
{
#if TEXTURED
    start_patch(s, p);
#endif
    const Rectangle over = p->share->over;
    const int top = (int)(over.y - over.high + HALF), bottom = ids ? (int)(over.y + over.high + HALF) : BLOCK - 1;
    PaintedRow painted;
    for (int line = top; line <= bottom; ++line) {
        start_row(p, line - HALF + p->offset.y, &painted);
        for (int at = line * BLOCK; at < (line + 1) * BLOCK; at += LANES) {
            const vi mine = ids ? EQ(VLOAD(ids + at), (vi)(p->share->id)) : (vi)(-1);
            if (!row_any(mine)) continue;
            const Row row = row_at(at);
            const vf x = row.x + p->offset.x;
            const Colour colour = row_albedo(s, p, &painted, row, x);
            Colour sum = p->series->lit ? series_row(s, p, &painted, colour, x, out->wants + at)
                                        : exact_row(s, r, p, colour, row, out->wants + at);
            if (ids) {
                const Colour before = {VLOAD(out->base + at), VLOAD(out->base + BLOCK_RAYS + at), VLOAD(out->base + 2 * BLOCK_RAYS + at)};
                sum = pick_colour(before, sum, mine);
            }
            store_row(out->base, at, sum);
        }
    }
}

// Whether some ray of a block meets nothing.
inline int some_miss(global const int *ids)
{
    vi missing = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) missing |= LT(VLOAD(ids + at), (vi)(0));
    return row_any(missing);
}

// The same for each triangle that shares a block.
inline void paint_shares(const Surfaces *s, const Bundle *r, const Shares *shares, global const int *ids, const BlockColours *out)
{
    if (some_miss(ids)) shade_nothing(s, out);
    for (int k = 0; k < shares->count; ++k) {
        FacetSeries series;
        Painting p;
        p.share = shares->of + k;
        p.finish = read_finish(s, p.share->facet->finish);
        p.series = &series;
        p.offset = -(float2)(p.share->over.x, p.share->over.y);
        facet_series(s, r, p.share->facet, &p.share->over, &p.finish, &series);
        paint_share(s, r, &p, ids, out);
    }
}

// A triangle that covers blocks of a beam, set up for all blocks of one element.
typedef struct {
    int id, element;         // triangle, -1 if there is none
    Facet facet;             // as seen from the middle of the element's blocks
    FacetSeries series;
} Cover;

inline void shift_form(Form *f, float2 by) { f->c = fma(by.x, f->i, fma(by.y, f->j, f->c)); }

// Triangle `id`, which covers a block, set up for it; returns the block's middle as the cover's series count it.
inline float2 cover_block(const Surfaces *s, const Rays *rays, const BeamWork *work, int block, int id, float pixel, Cover *cover, Facet *facet)
{
    const int element = block / ELEMENT_BLOCKS;
    const float2 offset = block_offset(block);
    if (cover->id != id || cover->element != element) {
        const Bundle r = element_bundle(rays, work, block);
        cover->id = id;
        cover->element = element;
        prepare_facet(s, &r, id, pixel, &cover->facet);
        const Finish finish = read_finish(s, cover->facet.finish);
        const Rectangle all = {0.0f, 0.0f, ELEMENT_HALF, ELEMENT_HALF};
        facet_series(s, &r, &cover->facet, &all, &finish, &cover->series);
    }
    *facet = cover->facet;
    shift_form(&facet->sum, offset);
    shift_form(&facet->over, offset);
    shift_form(&facet->under, offset);
#if SMOOTH
    for (int k = 0; k < 3; ++k) shift_form(facet->n + k, offset);
#endif
#if TEXTURED
    for (int k = 0; k < 2; ++k) shift_form(facet->uv + k, offset);
    facet->finish = choose_finish(s, id, facet, facet->over.c / facet->under.c, pixel);
#endif
#if VERTEX_COLOURS
    for (int k = 0; k < 3; ++k) shift_form(facet->rgb + k, offset);
#endif
    return offset;
}
#endif

#endif
