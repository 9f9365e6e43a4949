// Colours of the rays that triangles have of a block of one element.
//
// Lights that every ray of a share sees are summed before a ray is looked at, and so is a texture of which the rays meet
// no more than one cell: what is left is a quadratic in each colour.  Rays are visited down the columns of the block,
// so that what changes along a row is set up once.
#ifndef LFCORE_SHARE_COLOURS_CL
#define LFCORE_SHARE_COLOURS_CL
#include "light_series.cl"

#if OUTER == 1

// A facet while its rays in a block are lit.
typedef struct {
    const Share *share;
    Finish finish;
    const FacetSeries *series;
    float2 offset;                  // of the block's middle from where the series are counted
    Patch patch;
    int patched;                    // whether all texels come from the patch, at
    Quadratic x, y;                 // these places
    Tint light, shine;              // what is multiplied by the texture, of lights that all rays see, and what is not
    int shiny, tinted;              // tinted: the corners' one colour is part of the finish
    int apart[LIGHTS + 1], single;  // the `single` lights that some rays see
} Painting;

// Corners of one colour change the material's: what else would be the same is, to the last bit.
inline void tint_finish(Painting *p)
{
    p->tinted = 1;
#if VERTEX_COLOURS
    const Forms *f = &p->share->facet->of;
    const float8 differs = fabs(f->c) + fabs(f->i) + fabs(f->j);
    p->tinted = differs.s5 + differs.s6 + differs.s7 == 0.0f;
    if (p->tinted) p->finish.diffuse *= p->share->facet->first;
#endif
}

inline Surface surface_at(const Painting *p, Row at)
{
    Surface surface = interpolate(p->share->facet, at);
#if VERTEX_COLOURS
    if (p->tinted) surface.rgb.r = surface.rgb.g = surface.rgb.b = 1.0f;
#endif
    return surface;
}

// Sum the lights that all rays see.
inline void sum_lights(const Surfaces *s, Painting *p)
{
    const Tint nothing = {0.0f, 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    p->light = p->shine = nothing;
#if AMBIENT
    p->light.c = (float4)(s->ambient.xyz * p->finish.diffuse, 0.0f);
#endif
    p->shiny = 0;
#if EMISSION
    p->shine.c = (float4)(p->finish.emission, 0.0f);
    p->shiny = largest(p->finish.emission) > 0.0f;
#endif
    p->single = 0;
    for (int k = 0; k < LIGHTS; ++k) {
        const int facing = p->series->facing[k], seeing = k < OPEN_LIGHTS ? ALL_RAYS : p->share->seeing[k - OPEN_LIGHTS];
        if (facing == NO_RAY || seeing == NO_RAY) continue;
        if (facing == SOME_RAYS || seeing == SOME_RAYS) {
            p->apart[p->single++] = k;
            continue;
        }
        const float3 c = vload3(0, s->lights + k * LIGHT + 4);
        p->light = add_tinted(p->light, p->series->cosine[k], (float4)(c * p->finish.diffuse, 0.0f));
        if (!p->series->glossy[k]) continue;
        p->shine = add_tinted(p->shine, p->series->gloss[k], (float4)(c * p->finish.specular, 0.0f));
        p->shiny = 1;
    }
}

// Rays of a share down LANES columns of a block: from `column` on, and as places of the series.
typedef struct {
    int column, top, bottom;
    vf x;
    vf y;        // of the top row
} Stripe;

// Write the colours of those of a row of rays that meet triangle `own`: all of them if there are no `ids`.
inline void put_colours_of(global const int *ids, vi own, int at, Colour c, global float *base)
{
    if (ids) {
        const Colour before = {VLOAD(base + at), VLOAD(base + BLOCK_RAYS + at), VLOAD(base + 2 * BLOCK_RAYS + at)};
        c = pick_colour(before, c, EQ(VLOAD(ids + at), own));
    }
    store_row(base, at, c);
}

// Three quadratics.
typedef struct { Column r, g, b; } Columns;
inline Columns down_columns(const Tint *f, vf x)
{
#define CHANNEL(k) {f->c.k, f->x.k, f->y.k, f->xx.k, f->xy.k, f->yy.k}
    const Quadratic r = CHANNEL(x), g = CHANNEL(y), b = CHANNEL(z);
#undef CHANNEL
    const Columns c = {down_column(r, x), down_column(g, x), down_column(b, x)};
    return c;
}
inline Colour columns_at(Columns f, vf y)
{
    const Colour c = {column_at(f.r, y), column_at(f.g, y), column_at(f.b, y)};
    return c;
}

// A stripe whose colours are quadratics.
inline void paint_plain(const Tint *colour, const Stripe *stripe, global const int *ids, int own, global float *base)
{
    const Columns colours = down_columns(colour, stripe->x);
    vf y = stripe->y;
    for (int line = stripe->top; line <= stripe->bottom; ++line, y += 1.0f)
        put_colours_of(ids, own, line * BLOCK + stripe->column, columns_at(colours, y), base);
}

// The lights down a stripe: those that all rays see, and those that some do.
typedef struct { Columns light, shine; } Light;
typedef struct { Column cosine[LIGHTS + 1], gloss[LIGHTS + 1]; } PartLight;

inline Light light_down(const Painting *p, vf x)
{
    Light l;
    l.light = down_columns(&p->light, x);
    if (p->shiny) l.shine = down_columns(&p->shine, x);
    return l;
}

inline void part_light_down(const Painting *p, vf x, PartLight *l)
{
    for (int n = 0; n < p->single; ++n) {
        l->cosine[n] = down_column(p->series->cosine[p->apart[n]], x);
        l->gloss[n] = down_column(p->series->gloss[p->apart[n]], x);
    }
}

inline void add_light(Colour *sum, vf amount, float3 colour)
{
    sum->r = fma(amount, (vf)(colour.x), sum->r);
    sum->g = fma(amount, (vf)(colour.y), sum->g);
    sum->b = fma(amount, (vf)(colour.z), sum->b);
}

// Those of a row of a share's rays that see a light that casts shadows.
inline vi rays_seeing(const Share *share, int k, global const int *wants)
{
    return share->seeing[k] == SOME_RAYS ? VLOAD(wants + k * BLOCK_RAYS) : (vi)(share->seeing[k] == ALL_RAYS ? -1 : 0);
}

// Colours of a row of rays of such a texture; `wants` are those that see each light that casts shadows, where
// some do.  `single` and `shiny` are the painting's.
inline Colour lit_row(const Surfaces *s, const Painting *p, const Light *l, const PartLight *part, int single, int shiny, Colour texel,
                      vf y, global const int *wants)
{
    Colour light = columns_at(l->light, y), shine = {0.0f, 0.0f, 0.0f};
    if (shiny) shine = columns_at(l->shine, y);
    for (int n = 0; n < single; ++n) {
        const int k = p->apart[n];
        const float3 c = vload3(0, s->lights + k * LIGHT + 4);
        const vf diffuse = max(column_at(part->cosine[n], y), (vf)(0.0f));
        vi open = GT(diffuse, (vf)(0.0f));
        if (k >= OPEN_LIGHTS) open &= rays_seeing(p->share, k - OPEN_LIGHTS, wants);
        add_light(&light, AS_VF(AS_VI(diffuse) & open), c * p->finish.diffuse);
        if (!p->series->glossy[k]) continue;
        add_light(&shine, AS_VF(AS_VI(max(column_at(part->gloss[n], y), (vf)(0.0f))) & open), c * p->finish.specular);
    }
    const Colour sum = {fma(texel.r, light.r, shine.r), fma(texel.g, light.g, shine.g), fma(texel.b, light.b, shine.b)};
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
    p->patched = series->lit && series->drawn && patch->columns && p->tinted;
    if (!p->patched) return;
    p->x = scale_quadratic(series->across, patch->width);
    p->y = scale_quadratic(series->down, patch->height);
    p->x.c -= fma(patch->u - series->turn_u, patch->width, patch->left + 0.5f);
    p->y.c += fma(1.0f + patch->v - series->turn_v, patch->height, -(patch->top + 0.5f));
}

// A stripe of a patch of so many columns.
inline void paint_cells(const Surfaces *s, const Painting *p, int columns, int single, const Stripe *stripe, global const int *ids,
                        const BlockColours *out)
{
    const Column across = down_column(p->x, stripe->x), down = down_column(p->y, stripe->x);
    global float *base = out->base;
    global const int *wants = out->wants;
    const vi own = p->share->id;
    const int shiny = p->shiny;
    const Light light = light_down(p, stripe->x);
    PartLight part;
    if (single) part_light_down(p, stripe->x, &part);
    vf y = stripe->y;
    for (int at = stripe->top * BLOCK + stripe->column; at <= stripe->bottom * BLOCK + stripe->column; at += BLOCK, y += 1.0f) {
        const Colour texel = mix_patch(&p->patch, columns, column_at(across, y), column_at(down, y));
        put_colours_of(ids, own, at, lit_row(s, p, &light, &part, single, shiny, texel, y, wants + at), base);
    }
}

inline void paint_patch(const Surfaces *s, const Painting *p, const Stripe *stripe, global const int *ids, const BlockColours *out)
{
    const int columns = p->patch.columns;
    if (p->single || columns > 4) paint_cells(s, p, columns, p->single, stripe, ids, out);
    else if (columns == 2) paint_cells(s, p, 2, 0, stripe, ids, out);
    else if (columns == 3) paint_cells(s, p, 3, 0, stripe, ids, out);
    else paint_cells(s, p, 4, 0, stripe, ids, out);
}

// Term (j, i) of a patch's sum, in red, green and blue.
inline float4 patch_term(const Patch *p, int j, int i)
{
    private const float *d = (private const float *)p->d[j][i];
    return (float4)(d[0], d[LANES], d[2 * LANES], 0.0f);
}

// Colours of rays that meet one cell of the texture as quadratics about the middle of the share; false where they are not.
inline int cell_series(const Painting *p, Tint *colour)
{
    const Rectangle *over = &p->share->over;
    const float wide = over->wide, high = over->high;
    const float a = over->x + p->offset.x, b = over->y + p->offset.y;
    const Quadratic x = about(p->x, a, b), y = about(p->y, a, b);
    float product_rest;
    const Quadratic product = multiply(x, y, wide, high, &product_rest);
    const float4 twist = patch_term(&p->patch, 1, 1);
    Tint texture = {patch_term(&p->patch, 0, 0), 0.0f, 0.0f, 0.0f, 0.0f, 0.0f};
    texture = add_tinted(texture, x, patch_term(&p->patch, 0, 1));
    texture = add_tinted(texture, y, patch_term(&p->patch, 1, 0));
    texture = add_tinted(texture, product, twist);
    const Tint light = tint_about(p->light, a, b);
    float4 rest;
    const Tint mixed = multiply_tints(texture, light, tint_about(p->shine, a, b), wide, high, &rest);
    const float4 brightest = fabs(light.c) + SLOPE(light, wide, high) + BEND(light, wide, high);
    rest += fabs(twist) * product_rest * brightest;
    const float4 spread = SLOPE(mixed, wide, high) + BEND(mixed, wide, high);
    *colour = mixed;
    return all(rest.xyz <= LIGHT_ERROR) && all(mixed.c.xyz >= spread.xyz);
}
#endif

// A row of rays without series.
inline Colour exact_row(const Surfaces *s, const Bundle *r, const Painting *p, int at, global const int *wants)
{
    const Row row = row_at(at);
    const Surface surface = surface_at(p, row);
    const Colour colour = albedo(s, &p->finish, &surface, &p->patch);
    const Meeting m = make_meeting(&surface, r, row, quotient_row(p->share->facet->over, p->share->facet->under, row));
    Colour sum = unshadowed(s, &p->finish, colour, &m);
    for (int k = 0; k < SHADOW_LIGHTS; ++k) {
        const vi open = rays_seeing(p->share, k, wants);
        if (!row_any(open)) continue;
        vi facing;
        const Colour c = light_row(s->lights + (OPEN_LIGHTS + k) * LIGHT, &p->finish, colour, m.point, m.normal, m.view, &facing);
        sum.r += pick((vf)(0.0f), c.r, open); sum.g += pick((vf)(0.0f), c.g, open); sum.b += pick((vf)(0.0f), c.b, open);
    }
    return sum;
}

// Any stripe.
inline void paint_stripe(const Surfaces *s, const Bundle *r, const Painting *p, const Stripe *stripe, global const int *ids,
                         const BlockColours *out)
{
    Light light;
    PartLight part;
    if (p->series->lit) {
        light = light_down(p, stripe->x);
        part_light_down(p, stripe->x, &part);
    }
    vf y = stripe->y;
    for (int line = stripe->top; line <= stripe->bottom; ++line, y += 1.0f) {
        const int at = line * BLOCK + stripe->column, own = p->share->id;
        if (ids && !row_any(EQ(VLOAD(ids + at), (vi)(own)))) continue;
        Colour c;
        if (p->series->lit) {
            const Surface surface = surface_at(p, row_at(at));
            c = lit_row(s, p, &light, &part, p->single, p->shiny, texel(s, &p->finish, &surface, &p->patch), y, out->wants + at);
        } else c = exact_row(s, r, p, at, out->wants + at);
        put_colours_of(ids, own, at, c, out->base);
    }
}

// How a share's rays are painted, from the quickest way on.
enum { PLAIN, PATCHED, ANY };

// Colours of a share's rays: all of its rectangle if there are no `ids`.
inline void paint_share(const Surfaces *s, const Bundle *r, Painting *p, global const int *ids, const BlockColours *out)
{
    const Rectangle over = p->share->over;
    Tint colour;
    float2 from = p->offset;        // where the places of `colour` are counted from
    int way = ANY;
    tint_finish(p);
    if (p->series->lit) sum_lights(s, p);
    const int even = p->series->lit && !p->single && p->tinted;
#if TEXTURED
    start_patch(s, p);
    if (p->patched) {
        way = PATCHED;
        if (even && max(p->patch.columns, p->patch.rows) == 2 && cell_series(p, &colour)) {
            way = PLAIN;
            from = -(float2)(over.x, over.y);
        }
    }
#endif
    if (even && !p->finish.image.y) {
        way = PLAIN;
        const Tint sum = {p->light.c + p->shine.c, p->light.x + p->shine.x, p->light.y + p->shine.y,
                          p->light.xx + p->shine.xx, p->light.xy + p->shine.xy, p->light.yy + p->shine.yy};
        colour = sum;
    }
    Stripe stripe;
    stripe.top = (int)(over.y - over.high + HALF);
    stripe.bottom = ids ? (int)(over.y + over.high + HALF) : BLOCK - 1;
    const int left = (int)(over.x - over.wide + HALF), right = ids ? (int)(over.x + over.wide + HALF) : BLOCK - 1;
    for (stripe.column = left / LANES * LANES; stripe.column <= right; stripe.column += LANES) {
        const float2 here = way == PLAIN ? from : p->offset;
        stripe.x = IOTA + (stripe.column - HALF + here.x);
        stripe.y = stripe.top - HALF + here.y;
        if (way == PLAIN) {
            paint_plain(&colour, &stripe, ids, p->share->id, out->base);
            continue;
        }
#if TEXTURED
        if (way == PATCHED) {
            paint_patch(s, p, &stripe, ids, out);
            continue;
        }
#endif
        paint_stripe(s, r, p, &stripe, ids, out);
    }
}

// Whether some ray of a block meets nothing.
inline int some_miss(global const int *ids)
{
    vi missing = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) missing |= LT(VLOAD(ids + at), (vi)(0));
    return row_any(missing);
}

// Colours of a block's rays, of each triangle that shares it, and of nothing.
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
        facet_series(s, r, p.share->facet, &p.share->over, &p.finish, p.share->seeing, &series);
        paint_share(s, r, &p, ids, out);
    }
}
#endif

#endif
