// Surfaces of a scene, and what a triangle interpolates over a block: quotients of affine forms.
#ifndef LFCORE_FACETS_CL
#define LFCORE_FACETS_CL
#include "visibility.cl"
#include "texture.cl"
#include "series.cl"

#define LIGHTS (OPEN_LIGHTS + SHADOW_LIGHTS)
#if POINT_LIGHTS && DIRECTIONAL_LIGHTS
#define IS_POINT(light) ((light)[3] != 0.0f)
#else
#define IS_POINT(light) POINT_LIGHTS
#endif
#define ATTRIBUTES (9 * SMOOTH + 6 * TEXTURED + 9 * VERTEX_COLOURS)
#define MATERIAL 12
#define LIGHT 16
#define LIGHT_NORMAL 8
#define LIGHT_OWN 12
#define MIP_LEVELS 12

typedef struct {
    global const float *corners;     // (T, 9)
    global const float *attributes;  // (T, ATTRIBUTES): normals, texture coordinates, colours of the corners
    global const int *material_ids;  // (T,)
    global const float *materials;   // (K, MATERIAL): diffuse, shininess, specular, texture, emission, dull (see Finish)
    global const float *lights;      // (LIGHTS, LIGHT): vector, 1 if a point, colour, reference distance; of a point of an
                                     // emitter its normal or 0, 0, and as integers its first triangle and that after its last
    global const int4 *images;       // (textures, MIP_LEVELS): offset, width, height, number of levels
    global const uint *texels;
    float4 ambient, background;
} Surfaces;

#define SURFACES_PARAMETERS                  \
    global const float *restrict corners,    \
    global const float *restrict attributes, \
    global const int *restrict material_ids, \
    global const float *restrict materials,  \
    global const float *restrict lights,     \
    global const int4 *restrict images,      \
    global const uint *restrict texels,      \
    const float4 ambient,                    \
    const float4 background
#define MAKE_SURFACES {corners, attributes, material_ids, materials, lights, images, texels, ambient, background}

inline Form sum_forms(const Form *e)
{
    Form f;
#define SUM(x) f.x = e[0].x + e[1].x + e[2].x
    SUM(c); SUM(i); SUM(j);
#if OUTER > 1
    SUM(p); SUM(q); SUM(k);
#endif
#undef SUM
    return f;
}

inline Form edge_form(float3 p, float3 q, const Bundle *r)
{
    const float3 c = cross_product(p, q);
    Form e;
    e.c = c.z;
    e.i = c.x * r->tx + (p.y - q.y) * r->sx;
    e.j = c.y * r->ty - (p.x - q.x) * r->sy;
#if OUTER > 1
    e.p = c.x * r->b + (p.y - q.y) * r->a;
    e.q = c.y * r->b - (p.x - q.x) * r->a;
    e.k = (p.z - q.z) * (r->sx * r->b - r->a * r->tx);
#endif
    return e;
}

#if SMOOTH || TEXTURED || VERTEX_COLOURS
// Forms of what corners have, side by side: normals, texture coordinates, and colours as differences from the first
// corner's, so that equal corners give just their colour.
enum { NORMAL = 0, COORDINATES = 3, SHADE = 5 };
typedef struct {
    float8 c, i, j;
#if OUTER > 1
    float8 p, q, k;
#endif
} Forms;

inline Form form_of(const Forms *f, int which)
{
    Form one;
#define TAKE(x) one.x = ((const float *)&f->x)[which]
    TAKE(c); TAKE(i); TAKE(j);
#if OUTER > 1
    TAKE(p); TAKE(q); TAKE(k);
#endif
#undef TAKE
    return one;
}

// What corner `k` of a triangle has.
inline float8 corner_attributes(global const float *attributes, int k)
{
    float8 a = 0.0f;
#if SMOOTH
    a.s012 = vload3(k, attributes);
    attributes += 9;
#endif
#if TEXTURED
    a.s34 = vload2(k, attributes);
    attributes += 6;
#endif
#if VERTEX_COLOURS
    a.s567 = vload3(k, attributes) - vload3(0, attributes);
#endif
    return a;
}
#endif

// One triangle prepared for a block.
typedef struct {
    Form sum;             // of the barycentric weights
    Form over, under;     // depth is their quotient; `under` is positive at the block's centre
#if !SMOOTH
    float3 normal;        // geometric, towards the viewer
#endif
#if SMOOTH || TEXTURED || VERTEX_COLOURS
    Forms of;
#endif
#if VERTEX_COLOURS
    float3 first;         // colour of the first corner
#endif
    int finish;           // see Finish
} Facet;

// What a surface is made of: a material and, where it is textured, one mip level of its texture.
// Numbered material * MIP_LEVELS + level, so that triangles alike can be lit together.
typedef struct {
    float3 diffuse, specular, emission;
    float shininess, dull;  // gloss is nothing where the cosine is below `dull`
    int4 image;           // width 0 without a texture
} Finish;

inline Finish read_finish(const Surfaces *s, int number)
{
    global const float *material = s->materials + number / MIP_LEVELS * MATERIAL;
    Finish f;
    f.diffuse = vload3(0, material);
    f.shininess = material[3];
    f.specular = vload3(0, material + 4);
    f.emission = vload3(0, material + 8);
    f.dull = material[11];
    f.image = 0;
#if TEXTURED
    const int texture = as_int(material[7]);
    if (texture >= 0) f.image = s->images[texture * MIP_LEVELS + number % MIP_LEVELS];
#endif
    return f;
}

// Interpolated surface of a row of rays.
typedef struct { vf x, y, z; } Vec;
typedef struct {
    Vec normal;           // neither unit nor turned to the viewer yet
#if TEXTURED
    vf u, v;
#endif
#if VERTEX_COLOURS
    Colour rgb;
#endif
} Surface;

inline float3 corner(global const float *c, int k) { return (float3)(c[3 * k], c[3 * k + 1], c[3 * k + 2]); }

#if TEXTURED
// The mip level whose texels are about as large as a pixel's footprint at the block's centre.  The
// footprint covers z^2 pixel^2 |D| / cos of the surface, and n . D, the sum of the weights, is twice the
// triangle's area times that cosine times |D|: area and cosine need not be known apart.
inline int choose_level(const Surfaces *s, int texture, global const float *uv, const Facet *f, float depth, float pixel)
{
    const int4 finest = s->images[texture * MIP_LEVELS];
    const float twice = fabs((uv[2] - uv[0]) * (uv[5] - uv[1]) - (uv[4] - uv[0]) * (uv[3] - uv[1]));
    const float texels = twice * finest.y * finest.z * (depth * pixel) * (depth * pixel) / max(fabs(f->sum.c), 1.0e-30f);
    // Half the logarithm to base 2, rounded, from the exponent: a call of a logarithm would spill every vector register.
    const int level = texels > 2.0f ? ((as_int(2.0f * texels) >> 23) - 127) >> 1 : 0;
    return min(level, finest.w - 1);
}
#endif

// What a triangle is made of where its facet's forms are counted from, at `depth`.
inline int choose_finish(const Surfaces *s, int id, const Facet *f, float depth, float pixel)
{
    const int material = s->material_ids[id];
    int number = material * MIP_LEVELS;
#if TEXTURED
    const int texture = as_int(s->materials[material * MATERIAL + 7]);
    if (texture >= 0) number += choose_level(s, texture, s->attributes + (long)id * ATTRIBUTES + 9 * SMOOTH, f, depth, pixel);
#endif
    return number;
}

// A constant and multiples of the steps of rays along x and y.
inline Form plane_form(float c, float x, float y, float step_x, float step_y, float outer)
{
    Form f;
    f.c = c; f.i = x * step_x; f.j = y * step_y;
#if OUTER > 1
    f.p = x * outer; f.q = y * outer; f.k = 0.0f;
#endif
    return f;
}

inline void prepare_facet(const Surfaces *s, const Bundle *r, int id, float pixel, Facet *f)
{
    global const float *at = s->corners + id * 9;
    const float3 p = corner(at, 0), q = corner(at, 1), w = corner(at, 2);
    const float3 shear = (float3)(r->dx, r->dy, 0.0f), origin = (float3)(r->ox, r->oy, 0.0f);
    const float3 v[3] = {p - origin - p.z * shear, q - origin - q.z * shear, w - origin - w.z * shear};
    const Form e[3] = {edge_form(v[1], v[2], r), edge_form(v[2], v[0], r), edge_form(v[0], v[1], r)};
    f->sum = sum_forms(e);
    float3 n = cross_product(v[1] - v[0], v[2] - v[0]);
    if (n.z < 0.0f) n = -n;
    f->over = plane_form(inner_product(n, v[0]), -n.x, -n.y, r->sx, r->sy, r->a);
    f->under = plane_form(n.z, n.x, n.y, r->tx, r->ty, r->b);
#if !SMOOTH
    // The sum of the weights is n . D: negative when the corners turn towards the viewer.
    const float sign = f->sum.c < 0.0f ? -1.0f : 1.0f;
    f->normal = -sign * direction_of(cross_product(q - p, w - p));
#endif
    global const float *attributes = s->attributes + (long)id * ATTRIBUTES;
#if SMOOTH || TEXTURED || VERTEX_COLOURS
    const float8 corners[3] = {corner_attributes(attributes, 0), corner_attributes(attributes, 1), corner_attributes(attributes, 2)};
#define BLEND(x) f->of.x = corners[0] * e[0].x + corners[1] * e[1].x + corners[2] * e[2].x
    BLEND(c); BLEND(i); BLEND(j);
#if OUTER > 1
    BLEND(p); BLEND(q); BLEND(k);
#endif
#undef BLEND
#endif
#if VERTEX_COLOURS
    f->first = vload3(0, attributes + 9 * SMOOTH + 6 * TEXTURED);
#endif
    f->finish = choose_finish(s, id, f, (p.z * e[0].c + q.z * e[1].c + w.z * e[2].c) / f->sum.c, pixel);
}

inline vf dot3(Vec a, Vec b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
inline Vec scale3(Vec a, vf k) { Vec r = {a.x * k, a.y * k, a.z * k}; return r; }

inline Surface interpolate(const Facet *f, Row at)
{
    Surface p;
#if SMOOTH
    p.normal.x = form_row(form_of(&f->of, NORMAL), at);
    p.normal.y = form_row(form_of(&f->of, NORMAL + 1), at);
    p.normal.z = form_row(form_of(&f->of, NORMAL + 2), at);
#else
    // Some rays of a block may see the triangle's other side.
    const vi back = AS_VI(flat_row(f->under, at)) & (vi)(0x80000000);
    p.normal.x = flip_sign((vf)(f->normal.x), back);
    p.normal.y = flip_sign((vf)(f->normal.y), back);
    p.normal.z = flip_sign((vf)(f->normal.z), back);
#endif
#if TEXTURED || VERTEX_COLOURS
    const vf inverse = reciprocal(flat_row(f->sum, at));
#endif
#if TEXTURED
    p.u = form_row(form_of(&f->of, COORDINATES), at) * inverse;
    p.v = form_row(form_of(&f->of, COORDINATES + 1), at) * inverse;
#endif
#if VERTEX_COLOURS
    p.rgb.r = fma(form_row(form_of(&f->of, SHADE), at), inverse, (vf)(f->first.x));
    p.rgb.g = fma(form_row(form_of(&f->of, SHADE + 1), at), inverse, (vf)(f->first.y));
    p.rgb.b = fma(form_row(form_of(&f->of, SHADE + 2), at), inverse, (vf)(f->first.z));
#endif
    return p;
}

#if TEXTURED && OUTER == 1
// The texels under a rectangle of a block, if it lay wholly on one triangle: quotients of affine forms have their extremes in
// corners.
inline void facet_patch(const Surfaces *s, const Facet *f, const Rectangle *over, int4 image, Patch *patch)
{
    const float4 x = (float4)(-over->wide, over->wide, -over->wide, over->wide) + over->x;
    const float4 y = (float4)(-over->high, -over->high, over->high, over->high) + over->y;
    const float4 inverse = 1.0f / fma(x, f->sum.i, fma(y, f->sum.j, f->sum.c));
    float lo[2], hi[2];
    for (int axis = 0; axis < 2; ++axis) {
        const Form g = form_of(&f->of, COORDINATES + axis);
        const float4 at = fma(x, g.i, fma(y, g.j, g.c)) * inverse;
        lo[axis] = min(min(at.x, at.y), min(at.z, at.w));
        hi[axis] = max(max(at.x, at.y), max(at.z, at.w));
    }
    make_patch(s->texels, image, lo[0], hi[0], lo[1], hi[1], patch);
}
#endif

// a where the mask is unset, b where it is set
inline Surface pick_surface(Surface a, Surface b, vi mask)
{
    a.normal.x = pick(a.normal.x, b.normal.x, mask); a.normal.y = pick(a.normal.y, b.normal.y, mask);
    a.normal.z = pick(a.normal.z, b.normal.z, mask);
#if TEXTURED
    a.u = pick(a.u, b.u, mask); a.v = pick(a.v, b.v, mask);
#endif
#if VERTEX_COLOURS
    a.rgb.r = pick(a.rgb.r, b.rgb.r, mask); a.rgb.g = pick(a.rgb.g, b.rgb.g, mask); a.rgb.b = pick(a.rgb.b, b.rgb.b, mask);
#endif
    return a;
}

#endif
