// Textures: the mip level for a footprint, the direction in which coordinates grow, and colours:
// bilinear, wrapping, in linear light, from one buffer of packed texels.
//
// A texel holds the square roots of its three linear values in 10 bits each.  Decoding takes one
// load and one multiplication per channel, and steps are no coarser than those of 8-bit sRGB.
#pragma once
#include "surfaces.cl"

// A material's texture for a map; -1: none.
inline int map_of(global const MaterialRecord *material, int map)
{
    return TEXTURED ? material->maps[map] : -1;
}
inline MipLevel level_of(const Scene *s, int texture, int level)
{
    return texture < 0 ? (MipLevel){0, 0, 0, 0} : s->mip_levels[texture * MIP_LEVELS + level];
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
inline void read_maps(const Scene *s, global const MaterialRecord *material, int level, MipLevel *maps)
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
    const MipLevel finest = level_of(s, texture, 0);
    const float4 edges = coordinate_edges(s, triangle);
    const float twice = fabs(edges.x * edges.w - edges.z * edges.y);
    const float area = twice * finest.width * finest.height * footprint * footprint;
    const float texels = 2.0f * area / max(fabs(weights), NOTHING_LEFT);
    // Half the logarithm to base 2, rounded, from the exponent: a call of a logarithm would
    // spill every vector register.
    const int level = texels > 2.0f ? ((as_int(2.0f * texels) >> FRACTION_BITS) - FLOAT_BIAS) >> 1 : 0;
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
inline Vec sample_texture(global const uint *texels, MipLevel image, vf u, vf v)
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
