// Textures: bilinear, wrapping, in linear light, from one buffer of packed texels.
//
// A texel holds the square roots of its three linear values in 10 bits each: one load, one multiply
// a channel to decode, and steps no coarser than those of 8-bit sRGB.
#pragma once
#include "block.cl"

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
    const vi x0 = clamp(TO_VI(left), (vi)(-1), (vi)(width));
    const vi y0 = clamp(TO_VI(top), (vi)(-1), (vi)(height));
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

// A texel patch, the few texels that rays of a block fall into: bilinear interpolation between them
// is
//     sum of d[j][i] s_i(x) s_j(y),  s_0 = 1,  s_1(x) = x,  s_k(x) = min(x, k - 1)
// from the first texel to the last: no addresses, and no gathers, by the ray.
#define TEXEL_PATCH 5
typedef struct {
    int columns, rows;      // texels, at least two; 0 where there are too many
    float u, v, left, top;  // whole numbers: turns of the texture, and the first texel within it
    float width, height;
    float4 d[TEXEL_PATCH][TEXEL_PATCH];
} TexelPatch;

// Texels along a line, one after the other, to the coefficients of such a sum.
typedef struct { float4 before, slope; } Summing;
inline float4 next_term(Summing *s, float4 texel)
{
    const float4 rise = texel - s->before, term = s->slope - rise;
    s->before = texel;
    s->slope = rise;
    return term;
}

inline float4 decode_texel(uint packed)
{
    const uint4 shift = (uint4)(0, TEXEL_BITS, 2 * TEXEL_BITS, 0);
    const uint4 texel = (uint4)(packed) >> shift & (uint4)((uint3)(TEXEL_MOST), 0);
    const float4 root = convert_float4(as_int4(texel)) * (1.0f / (float)TEXEL_MOST);
    return root * root;
}

// The patch of rays whose coordinates lie within `range`: least u and v, most u and v.
inline void make_patch(global const uint *texels, Level image, float4 range, TexelPatch *p)
{
    const float u0 = range.x, v0 = range.y, u1 = range.z, v1 = range.w;
    p->columns = 0;
    p->u = floor(u0);
    p->v = floor(v1);
    p->width = image.width;
    p->height = image.height;
    p->left = floor(fma(u0 - p->u, p->width, -0.5f));
    p->top = floor(fma(1.0f - (v1 - p->v), p->height, -0.5f));
    const float across = fma(u1 - p->u, p->width, -0.5f) - p->left;
    const float down = fma(1.0f - (v0 - p->v), p->height, -0.5f) - p->top;
    if (!(across < TEXEL_PATCH - 1 && down < TEXEL_PATCH - 1)) return;
    p->columns = (int)across + 2;
    p->rows = (int)down + 2;
    const int first = p->left < 0.0f ? image.width - 1 : (int)p->left;
    int line = p->top < 0.0f ? image.height - 1 : (int)p->top;
    for (int j = 0; j < p->rows; ++j, line = line + 1 < image.height ? line + 1 : 0) {
        global const uint *row = texels + image.offset + line * image.width;
        Summing along = {decode_texel(row[first]), 0.0f};
        p->d[j][0] = along.before;
        for (int i = 1, column = first; i < p->columns; ++i) {
            column = column + 1 < image.width ? column + 1 : 0;
            p->d[j][i] = next_term(&along, decode_texel(row[column]));
        }
        p->d[j][1] = along.slope;
    }
    for (int i = 0; i < p->columns; ++i) {
        Summing down = {p->d[0][i], 0.0f};
        for (int j = 1; j < p->rows; ++j) p->d[j][i] = next_term(&down, p->d[j][i]);
        p->d[1][i] = down.slope;
    }
}

// One row of such a sum, of `columns` terms.
inline Vec mix_row(private const float4 *d, int columns, private const vf *s)
{
    Vec row = spread3(d[0].xyz);
    for (int i = 1; i < columns; ++i) row = fma3(s[i], spread3(d[i].xyz), row);
    return row;
}

// The colour at texture coordinates within the patch.
inline Vec sample_patch(const TexelPatch *p, vf u, vf v)
{
    // In texels from the centre of the first one.
    const vf x = fma(u - p->u, (vf)(p->width), (vf)(-0.5f)) - p->left;
    const vf y = fma(1.0f - (v - p->v), (vf)(p->height), (vf)(-0.5f)) - p->top;
    const int columns = p->columns;
    vf s[TEXEL_PATCH];
    s[1] = x;
    for (int i = 2; i < columns; ++i) s[i] = min(x, (vf)(i - 1.0f));
    Vec sum = fma3(y, mix_row(p->d[1], columns, s), mix_row(p->d[0], columns, s));
    vf most = 1.0f;
    for (int j = 2; j < p->rows; ++j, most += 1.0f)
        sum = fma3(min(y, most), mix_row(p->d[j], columns, s), sum);
    return sum;
}
