// Blocks of one element that lie on few triangles, painted triangle by triangle once it is known which rays see
// the lights that cast shadows.
//
// Where a triangle is in one cell of its texture (between the centres of four texels) and in the same lights, its colour
// varies little over such a block: it is a truncated series, of which every ray takes two multiply-adds a channel.
// Rays in one cell and the same lights are of one state; a state's series is made when a ray first needs it.  Where
// a series would cut off more than COLOUR_ERROR (near lights, terminators, highlights narrower than the block), the
// triangle is computed ray by ray.  Where nothing but frames is wanted, the series are of their codes.
#ifndef LFCORE_FEW_CL
#define LFCORE_FEW_CL
#include "shading.cl"
#include "series.cl"

#define ENCODED (FRAMES && !PLANES)
#if ENCODED
#include "frames.cl"
#endif

#if OUTER == 1
#define FEW 8
#define ALONG 3                     // cells along a side of a patch
#define LIT (1 << SHADOW_LIGHTS)    // which of the lights that cast shadows are seen
#define STATES (ALONG * ALONG * LIT)
// What series may cut off: of linear light, or of a code of 8 bits; 0 has every ray computed.
#ifndef COLOUR_ERROR
#define COLOUR_ERROR (ENCODED ? 0.03f : 3.0e-5f)
#endif
// Of a texel, of where cells meet.
#define CELL_ERROR 2.0e-3f
// Highlights that fall by more powers of two than this over a block are computed ray by ray.
#define GLOSS_RANGE 6.0f

// A facet at the nodes.
typedef struct {
    float albedo[3][NODES];  // without its texture
    float x[NODES], y[NODES];  // on its patch
    float side[NODES];  // normal times direction
    float cosine[LIGHTS + 1][NODES], halfway[LIGHTS + 1][NODES], gloss[LIGHTS + 1][NODES];  // the first and last times strength
} FacetNodes;

// A facet, and its states so far.
typedef struct {
    const Facet *facet;
    Finish finish;
    Patch patch;
    FacetNodes nodes;
    Quadratic x, y;          // on the patch
    Quadratic colour[STATES][3];
    uchar made[STATES];
} Painting;

inline void facet_nodes(const Surfaces *s, const Bundle *r, Painting *p)
{
    const Facet *f = p->facet;
    const int glossy = is_glossy(&p->finish);
    FacetNodes *out = &p->nodes;
    for (int at = 0; at < NODES; at += LANES) {
        const Places here = nodes_at(at);
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
            const Incidence in = incidence(s->lights + k * LIGHT, glossy, point, normal, view);
            VSTORE(in.cosine * in.strength, out->cosine[k] + at);
            VSTORE(in.halfway, out->halfway[k] + at);
            if (glossy) VSTORE(gloss_of(&p->finish, in), out->gloss[k] + at);
        }
        Colour albedo = {p->finish.diffuse.x, p->finish.diffuse.y, p->finish.diffuse.z};
#if TEXTURED || VERTEX_COLOURS
        const vf inverse = reciprocal(form_nodes(f->sum, here));
#endif
#if VERTEX_COLOURS
        albedo.r *= fma(form_nodes(f->rgb[0], here), inverse, (vf)(f->first.x));
        albedo.g *= fma(form_nodes(f->rgb[1], here), inverse, (vf)(f->first.y));
        albedo.b *= fma(form_nodes(f->rgb[2], here), inverse, (vf)(f->first.z));
#endif
        VSTORE(albedo.r, out->albedo[0] + at);
        VSTORE(albedo.g, out->albedo[1] + at);
        VSTORE(albedo.b, out->albedo[2] + at);
#if TEXTURED
        if (p->finish.image.y) {
            VSTORE(patch_x(&p->patch, form_nodes(f->uv[0], here) * inverse), out->x + at);
            VSTORE(patch_y(&p->patch, form_nodes(f->uv[1], here) * inverse), out->y + at);
        }
#endif
    }
}

// Whether a light varies so little over the block, and its highlight with it, that nodes tell all of it.  Cosines and
// highlights that are nothing all over the block become so at the nodes.
inline int light_is_smooth(Painting *p, int k)
{
    const Series cosine = make_series(p->nodes.cosine[k]);
    const float spread = series_spread(&cosine);
    const int faces = cosine.row[0].x > spread, glossy = is_glossy(&p->finish);
    if (!faces && !(cosine.row[0].x < -spread)) return 0;
    int shines = 0;
    if (faces && glossy) {
        const Series halfway = make_series(p->nodes.halfway[k]);
        const float reach = series_spread(&halfway), most = halfway.row[0].x + reach, least = halfway.row[0].x - reach;
        shines = !(most < p->finish.dull);
        if (shines && !(least > 0.0f && p->finish.shininess * native_log2(most / least) < GLOSS_RANGE)) return 0;
    }
    for (int node = 0; node < NODES; ++node) {
        if (!faces) p->nodes.cosine[k][node] = 0.0f;
        if (glossy && !shines) p->nodes.gloss[k][node] = 0.0f;
    }
    return 1;
}

// Prepare a facet for series; false where it must be computed ray by ray.
inline int start_painting(const Surfaces *s, const Bundle *r, Painting *p)
{
    if (!(COLOUR_ERROR > 0.0f)) return 0;
#if TEXTURED
    if (p->finish.image.y && (!p->patch.columns || max(p->patch.columns, p->patch.rows) > ALONG + 1)) return 0;
#endif
    facet_nodes(s, r, p);
#if SMOOTH
    const Series side = make_series(p->nodes.side);  // quadratic: exact
    if (!(fabs(side.row[0].x) > series_spread(&side))) return 0;
#endif
    for (int k = 0; k < LIGHTS; ++k)
        if (!light_is_smooth(p, k)) return 0;
#if TEXTURED
    if (p->finish.image.y && p->patch.columns * p->patch.rows > 4) {
        const Series x = make_series(p->nodes.x), y = make_series(p->nodes.y);
        if (!(series_rest(&x) + series_rest(&y) <= CELL_ERROR)) return 0;
        p->x = truncate(&x);
        p->y = truncate(&y);
    }
#endif
    for (int k = 0; k < STATES; ++k) p->made[k] = 0;
    return 1;
}

// Colours of LANES nodes, from node `at` on, in one state.
inline Colour node_colour(const Surfaces *s, const Painting *p, int state, int at)
{
    const FacetNodes *n = &p->nodes;
    Colour light = {0.0f, 0.0f, 0.0f}, shine = {0.0f, 0.0f, 0.0f};
#if AMBIENT
    light.r = s->ambient.x; light.g = s->ambient.y; light.b = s->ambient.z;
#endif
#if EMISSION
    shine.r = p->finish.emission.x; shine.g = p->finish.emission.y; shine.b = p->finish.emission.z;
#endif
    for (int k = 0; k < LIGHTS; ++k) {
        if (k >= OPEN_LIGHTS && !(state >> (k - OPEN_LIGHTS) & 1)) continue;
        const float3 c = vload3(0, s->lights + k * LIGHT + 4);
        const vf diffuse = VLOAD(n->cosine[k] + at);
        light.r = fma(diffuse, (vf)(c.x), light.r); light.g = fma(diffuse, (vf)(c.y), light.g); light.b = fma(diffuse, (vf)(c.z), light.b);
        if (!is_glossy(&p->finish)) continue;
        const vf gloss = VLOAD(n->gloss[k] + at);
        const float3 back = c * p->finish.specular;
        shine.r = fma(gloss, (vf)(back.x), shine.r); shine.g = fma(gloss, (vf)(back.y), shine.g); shine.b = fma(gloss, (vf)(back.z), shine.b);
    }
    Colour albedo = {VLOAD(n->albedo[0] + at), VLOAD(n->albedo[1] + at), VLOAD(n->albedo[2] + at)};
#if TEXTURED
    if (p->finish.image.y) {
        const int cell = state / LIT;
        const Colour t = sample_cell(&p->patch, cell % ALONG, cell / ALONG, VLOAD(n->x + at), VLOAD(n->y + at));
        albedo.r *= t.r; albedo.g *= t.g; albedo.b *= t.b;
    }
#endif
    const Colour sum = {fma(albedo.r, light.r, shine.r), fma(albedo.g, light.g, shine.g), fma(albedo.b, light.b, shine.b)};
    return sum;
}

#if ENCODED
// Whether what is clamped to 1 is so at all nodes, or far from it at all, so that it leaves no edge.
inline int keeps_clear(private const float *values)
{
    float least = values[0], most = values[0];
    for (int k = 1; k < NODES; ++k) { least = min(least, values[k]); most = max(most, values[k]); }
    const float margin = 0.25f * (most - least);
    return most + margin <= 1.0f || least - margin >= 1.0f;
}
#endif

// Make a state's series; false where they would cut off too much.
inline int make_state(const Surfaces *s, Painting *p, int state)
{
    private float values[3][NODES];
    for (int at = 0; at < NODES; at += LANES) {
        const Colour c = node_colour(s, p, state, at);
        VSTORE(c.r, values[0] + at);
        VSTORE(c.g, values[1] + at);
        VSTORE(c.b, values[2] + at);
    }
#if ENCODED
    if (!keeps_clear(values[0]) || !keeps_clear(values[1]) || !keeps_clear(values[2])) return 0;
    for (int at = 0; at < NODES; at += LANES) {
        const Colour linear = {VLOAD(values[0] + at), VLOAD(values[1] + at), VLOAD(values[2] + at)};
        const Colour c = to_codes(linear);
        VSTORE(c.r, values[0] + at);
        VSTORE(c.g, values[1] + at);
        VSTORE(c.b, values[2] + at);
    }
#endif
    for (int channel = 0; channel < 3; ++channel) {
        const Series series = make_series(values[channel]);
        if (!(series_rest(&series) <= COLOUR_ERROR * (ENCODED ? CODES : 1))) return 0;
        p->colour[state][channel] = truncate(&series);
    }
    p->made[state] = 1;
    return 1;
}

// The state of each ray of a row; `wants` are those that see each light that casts shadows.
inline vi row_states(const Painting *p, Row row, global const int *wants)
{
    vi state = 0;
    for (int k = 0; k < SHADOW_LIGHTS; ++k) state |= VLOAD(wants + k * BLOCK_RAYS) & (vi)(1 << k);
#if TEXTURED
    if (p->finish.image.y && p->patch.columns * p->patch.rows > 4) {
        const vi x = min(TO_VI(max(quadratic_row(p->x, row), (vf)(0.0f))), (vi)(p->patch.columns - 2));
        const vi y = min(TO_VI(max(quadratic_row(p->y, row), (vf)(0.0f))), (vi)(p->patch.rows - 2));
        state += (y * ALONG + x) * LIT;
    }
#endif
    return state;
}

inline Colour state_row(const Painting *p, int state, Row row)
{
    const Quadratic *q = p->colour[state];
    const Colour c = {quadratic_row(q[0], row), quadratic_row(q[1], row), quadratic_row(q[2], row)};
    return c;
}

inline void blend_row(const BlockColours *out, int at, Colour c, vi mine)
{
    const Colour before = {VLOAD(out->base + at), VLOAD(out->base + BLOCK_RAYS + at), VLOAD(out->base + 2 * BLOCK_RAYS + at)};
    store_row(out->base, at, pick_colour(before, c, mine));
}

// Colours of the rays of a block that meet triangle `id`, all of them if there are no `ids`, by series; false where that
// will not do.
inline int paint_states(const Surfaces *s, Painting *p, global const int *ids, int id, const BlockColours *out)
{
    private int states[LANES];
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        vi mine = -1;
        if (ids) {
            mine = EQ(VLOAD(ids + at), (vi)(id));
            if (!row_any(mine)) continue;
        }
        const Row row = row_at(at);
        const vi state = row_states(p, row, out->wants + at);
        VSTORE(state, states);
        if (!row_any(~(mine & EQ(state, (vi)(states[0]))))) {
            if (!p->made[states[0]] && !make_state(s, p, states[0])) return 0;
            store_row(out->base, at, state_row(p, states[0], row));
            continue;
        }
        for (uint todo = row_bits(mine); todo;) {
            const int next = states[lowest(todo)];
            const vi those = mine & EQ(state, (vi)(next));
            if (!p->made[next] && !make_state(s, p, next)) return 0;
            blend_row(out, at, state_row(p, next, row), those);
            todo &= ~row_bits(those);
        }
    }
    return 1;
}

// A row's colours without series.
inline Colour exact_row(const Surfaces *s, const Bundle *r, const Painting *p, Row row, global const int *wants)
{
    const Finish *finish = &p->finish;
    const Surface surface = interpolate(p->facet, row);
    const Meeting m = make_meeting(&surface, r, row, quotient_row(p->facet->over, p->facet->under, row));
    const Colour colour = albedo(s, finish, &surface, &p->patch);
    Colour sum = unshadowed(s, finish, colour, &m);
    for (int k = 0; k < SHADOW_LIGHTS; ++k) {
        const vi open = VLOAD(wants + k * BLOCK_RAYS);
        if (!row_any(open)) continue;
        vi facing;
        const Colour c = light_row(s->lights + (OPEN_LIGHTS + k) * LIGHT, finish, colour, m.point, m.normal, m.view, &facing);
        sum.r += pick((vf)(0.0f), c.r, open); sum.g += pick((vf)(0.0f), c.g, open); sum.b += pick((vf)(0.0f), c.b, open);
    }
    return sum;
}

// The same ray by ray.
inline void paint_rays(const Surfaces *s, const Bundle *r, const Painting *p, global const int *ids, int id, const BlockColours *out)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi mine = ids ? EQ(VLOAD(ids + at), (vi)(id)) : (vi)(-1);
        if (!row_any(mine)) continue;
        Colour sum = exact_row(s, r, p, row_at(at), out->wants + at);
#if ENCODED
        sum = to_codes(sum);
#endif
        blend_row(out, at, sum, mine);
    }
}

inline void shade_facet(const Surfaces *s, const Bundle *r, const Facet *f, global const int *ids, int id, const BlockColours *out)
{
    Painting p;
    p.facet = f;
    p.finish = read_finish(s, f->finish);
#if TEXTURED
    p.patch.columns = 0;
    if (p.finish.image.y) facet_patch(s, f, p.finish.image, &p.patch);
#endif
    if (start_painting(s, r, &p) && paint_states(s, &p, ids, id, out)) return;
#if TEXTURED
    difference_patch(&p.patch);
#endif
    paint_rays(s, r, &p, ids, id, out);
}

// Where some ray of a block meets nothing, start with the background.
inline void fill_background(const Surfaces *s, global const int *ids, const BlockColours *out)
{
    Colour c = background_colour(s);
#if ENCODED
    c = to_codes(c);
#endif
    vi missing = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) missing |= LT(VLOAD(ids + at), (vi)(0));
    if (!row_any(missing)) return;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) store_row(out->base, at, c);
}

// Find the facets of a block; false where they are more than few, or one is seen from both sides or edge-on.
inline int few_facets(const Surfaces *s, const Bundle *r, global const int *ids, float pixel, Facets *facets)
{
    clear_facets(facets);
    int last = -1;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi row = VLOAD(ids + at);
        for (uint todo = row_bits(GE(row, (vi)(0)) & ~EQ(row, (vi)(last))); todo;) {
            last = ids[at + lowest(todo)];
            todo &= ~row_bits(EQ(row, (vi)(last)));
            if (!one_sided(find_facet(s, r, last, pixel, facets)) || facets->count > FEW) return 0;
        }
    }
    return !facets->lost;
}
#endif

#endif
