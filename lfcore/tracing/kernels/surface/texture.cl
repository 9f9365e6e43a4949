// Attributes of corners: normals, texture coordinates and colours; and textures: the mip level for
// a pixel's footprint, the direction in which coordinates grow, and colours: bilinear, wrapping, in
// linear light, from one buffer of packed texels.
//
// A texel holds the square roots of its three linear values in 10 bits each.  Decoding takes one
// load and one multiplication per channel, and steps are no coarser than those of 8-bit sRGB.
#pragma once
#include "equations.cl"

// The numbers per triangle: corners' normals, texture coordinates and colours, if a scene has them.
#define ATTRIBUTES (9 * SMOOTH + 6 * TEXTURED + 9 * VERTEX_COLOURS)

inline float3 corner(const Scene *s, int triangle, int k)
{
    return vload3(k, s->corners + triangle * 9);
}
inline global const float *attributes_of(const Scene *s, int triangle)
{
    return s->attributes + (long)triangle * ATTRIBUTES;
}

// A slot as an affine function over the block, from the corners' weights `e`.
inline WideAffine set_up_slot(const Scene *s, const TriangleRow *triangles, int slot,
                              const WideAffine *e)
{
    const int of_uv = TEXTURED && slot >= COORDINATES && slot < TINT;
    const int begin = slot < COORDINATES ? NORMAL : of_uv ? COORDINATES : TINT;
    global const float *from = s->attributes + 3 * (begin - FIRST_ATTRIBUTE) + slot - begin;
    vf at[3];
    for (int k = 0; k < 3; ++k)
        at[k] = read_lanes(from + k * (of_uv ? 2 : 3), triangles, ATTRIBUTES);
    for (int k = 2; k >= 0 && slot >= TINT; --k) at[k] -= at[0];
    WideAffine f;
    for (int k = 0; k < AFFINE_TERMS; ++k)
        f.term[k] = at[0] * e[0].term[k] + at[1] * e[1].term[k] + at[2] * e[2].term[k];
    return f;
}

// Values of an affine function with BILINEAR at a row of rays.
inline vf bilinear_row(Affine f, Row at)
{
    if (OUTER == 1) return affine_row(f, at);
    const float base = AT_OFFSETS(at.y, at.v, f.term[ONE], f.term[Y], f.term[V]);
    const float along = fma(-at.v, f.term[BILINEAR], f.term[X]);
    const float across = fma(at.y, f.term[BILINEAR], f.term[U]);
    return AT_OFFSETS(at.x, at.u, base, along, across);
}

// All slots of attributes.
inline void set_up_attributes(const Scene *s, const TriangleRow *triangles, const WideAffine *e,
                              WideEquations *out)
{
    for (int slot = FIRST_ATTRIBUTE; slot < WEIGHT; ++slot)
        out->slot[slot] = set_up_slot(s, triangles, slot, e);
    for (int slot = WEIGHT; slot < SLOTS; ++slot) out->slot[slot] = e[slot - WEIGHT + 1];
    for (int k = 0; k < 3 && VERTEX_COLOURS; ++k)
        out->first[k] = read_lanes(s->attributes + 3 * (TINT - FIRST_ATTRIBUTE) + k, triangles,
                                   ATTRIBUTES);
}

// A row of attributes, tangents and weights; `back` is the sign of n . D.
inline void interpolate_attributes(global const PlaneEquations *p, Row at, vi back, SampleRow *s)
{
    const vf weights = affine_row(p->weights, at);
    for (int k = FIRST_ATTRIBUTE; k < WEIGHT; ++k) s->value[k] = bilinear_row(p->slot[k], at);
    // Seen from behind, a flat triangle's tangent is negated with its normal; smooth ones follow
    // later.
    const vi behind = sign_of(SMOOTH ? weights : -weights);
    for (int k = 0; k < 4 && PHYSICAL; ++k)
        s->value[TANGENT + k] = flip_sign(p->tangent[k], k < 3 ? behind : back);
    if (SLOTS == COORDINATES) return;
    const vf inverse = reciprocal(weights);
    for (int k = COORDINATES; k < TINT; ++k) s->value[k] *= inverse;
    for (int k = TINT; k < WEIGHT; ++k)
        s->value[k] = fma(inverse, s->value[k], (vf)(p->first[k - TINT]));
    for (int k = WEIGHT; k < SLOTS; ++k)
        s->value[k] = bilinear_row(p->slot[k], at) * (inverse * (float)p->grid[2]);
    // The corners turn to the viewer where the weights are negative.
    s->first = pick_int((vi)(p->grid[1]), (vi)(p->grid[0]), LT(weights, (vf)(0.0f)));
    s->side = p->grid[2];
}

// Three quantities, from `first` on.
inline Vec *vectors_at(SampleRow *s, int first) { return (Vec *)(s->value + first); }

// Normalise interpolated normals, and turn normals and tangents to the viewer.
inline void turn_to_viewer(Vec direction, SampleRow *s)
{
    Vec *n = vectors_at(s, NORMAL), *tangent = vectors_at(s, TANGENT);
    *n = scale3(*n, inverse_sqrt(max(dot3(*n, *n), (vf)(LEAST_LENGTH))));
    const vi away = GT(dot3(*n, direction), (vf)(0.0f)) & (vi)(0x80000000);
    *n = turn_vectors(*n, away);
    if (PHYSICAL) *tangent = turn_vectors(*tangent, away);
}

// A material's texture for a map; -1: none.
inline int map_of(global const MaterialRecord *material, int map)
{
    return TEXTURED ? material->maps[map] : -1;
}
inline Level level_of(const Scene *s, int texture, int level)
{
    return texture < 0 ? (Level){0, 0, 0, 0} : s->levels[texture * MIP_LEVELS + level];
}

// The texture whose texels choose the mip level; -1 without textures.
inline int leading_map(global const MaterialRecord *material)
{
    int texture = map_of(material, MAP_BASE);
    for (int map = 1; PHYSICAL && map < MAPS && texture < 0; ++map) texture = map_of(material, map);
    return texture;
}

// A material's textures, at the levels with texels about as large as the leading texture's at
// `level`.
inline void read_maps(const Scene *s, global const MaterialRecord *material, int level, Level *maps)
{
    const int levels = level_of(s, leading_map(material), 0).levels;
    for (int map = 0; map < (PHYSICAL ? MAPS : 1); ++map) {
        const int texture = map_of(material, map), count = level_of(s, texture, 0).levels;
        maps[map] = level_of(s, texture, clamp(level - levels + count, 0, max(count - 1, 0)));
    }
}

// The differences of u and v along a triangle's two edges from its first corner.
inline float4 coordinate_edges(const Scene *s, int triangle)
{
    global const float *uv = attributes_of(s, triangle) + 9 * SMOOTH;
    return (float4)(uv[2] - uv[0], uv[3] - uv[1], uv[4] - uv[0], uv[5] - uv[1]);
}

// The mip level whose texels are about as large as a pixel's footprint at the block's centre.  The
// footprint covers z^2 pixel^2 |D| / cos of the surface, and the sum of the weights is four times
// the triangle's area times that cosine times |D|: their product suffices.
inline int mip_level(const Scene *s, int triangle, float weights, float footprint)
{
    const int texture = leading_map(s->materials + s->material_ids[triangle]);
    if (texture < 0) return 0;
    const Level finest = level_of(s, texture, 0);
    const float4 edges = coordinate_edges(s, triangle);
    const float twice = fabs(edges.x * edges.w - edges.z * edges.y);
    const float area = twice * finest.width * finest.height * footprint * footprint;
    const float texels = 2.0f * area / max(fabs(weights), NOTHING_LEFT);
    // Half the logarithm to base 2, rounded, from the exponent: a call of a logarithm would
    // spill every vector register.
    const int level = texels > 2.0f ? ((as_int(2.0f * texels) >> 23) - 127) >> 1 : 0;
    return min(level, finest.levels - 1);
}

// The direction of u on a triangle of edges a and b from its first corner, and the sign of v's
// beside it; `towards` is the normal on the side of the viewer.  As in glTF and MikkTSpace, v grows
// along the cross product of normal and tangent, or against it where a texture is mirrored.
inline float4 find_tangent(const Scene *s, int triangle, float3 a, float3 b, float3 towards)
{
    if (!TEXTURED) return (float4)(0.0f, 0.0f, 0.0f, 1.0f);
    const float4 e = coordinate_edges(s, triangle);
    const float turn = e.x * e.w - e.z * e.y < 0.0f ? -1.0f : 1.0f;
    const Vec tangent = directions_of(spread3(turn * (e.w * a - e.y * b)));
    const float3 along = ray_vector(&tangent, 0), up = turn * (e.x * b - e.z * a);
    const float side = inner_product(cross_product(towards, along), up);
    return (float4)(along, side < 0.0f ? -1.0f : 1.0f);
}

// Add mip level and, for PHYSICAL, the tangent to a triangle's plane equations.
inline void set_up_texture(const Scene *s, int triangle, float pixel_pitch,
                           global PlaneEquations *p)
{
    const float3 at = corner(s, triangle, 0);
    const float3 a = corner(s, triangle, 1) - at, b = corner(s, triangle, 2) - at;
    if (PHYSICAL) {
        const float3 n = cross_product(a, b), towards = p->weights.term[ONE] < 0.0f ? n : -n;
        vstore4(find_tangent(s, triangle, a, b, towards), 0, p->tangent);
    }
    const float depth = p->numerator.term[ONE] / p->denominator.term[ONE];
    if (TEXTURED) p->key += mip_level(s, triangle, p->weights.term[ONE], depth * pixel_pitch);
}

#define TEXEL_MOST ((1u << TEXEL_BITS) - 1u)

inline vu fetch(global const uint *texels, vi index)
{
    private int at[LANES];
    private uint texel[LANES];
    VSTORE(index, at);
    for (int k = 0; k < LANES; ++k) texel[k] = texels[at[k]];
    return VLOAD(texel);
}

inline Vec add_texel(Vec sum, vu texel, vf weight)
{
    const Vec root = {TO_VF(texel & TEXEL_MOST), TO_VF((texel >> TEXEL_BITS) & TEXEL_MOST),
                      TO_VF(texel >> 2 * TEXEL_BITS)};
    return fma3(weight, times3(root, root), sum);
}

// Wrap into [0, size) given x in [-1, size].
inline vi wrap(vi x, int size)
{
    x = pick_int(x, x + size, LT(x, (vi)(0)));
    return pick_int(x, x - size, GE(x, (vi)(size)));
}

// v runs up, row 0 is on top.
inline Vec sample_texture(global const uint *texels, Level image, vf u, vf v)
{
    const int width = image.width, height = image.height;
    const vf x = fma(u - floor(u), (vf)(width), (vf)(-0.5f));
    const vf y = fma(1.0f - (v - floor(v)), (vf)(height), (vf)(-0.5f));
    const vf left = floor(x), top = floor(y), fx = x - left, fy = y - top;
    // NaN outside a mask must not become an address.
    const vi x0 = clamp(TO_VI(left), (vi)(-1), (vi)(width - 1));
    const vi y0 = clamp(TO_VI(top), (vi)(-1), (vi)(height - 1));
    const vi xa = wrap(x0, width), xb = wrap(x0 + 1, width);
    const vi ya = wrap(y0, height) * width + image.offset;
    const vi yb = wrap(y0 + 1, height) * width + image.offset;
    const vf scale = 1.0f / ((float)TEXEL_MOST * (float)TEXEL_MOST);
    const vf wy = fy * scale, vy = (1.0f - fy) * scale;
    Vec sum = {0.0f, 0.0f, 0.0f};
    sum = add_texel(sum, fetch(texels, ya + xa), (1.0f - fx) * vy);
    sum = add_texel(sum, fetch(texels, ya + xb), fx * vy);
    sum = add_texel(sum, fetch(texels, yb + xa), (1.0f - fx) * wy);
    return add_texel(sum, fetch(texels, yb + xb), fx * wy);
}
