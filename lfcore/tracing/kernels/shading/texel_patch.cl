// Texel patches: the few texels that rays of a block fall into.  Bilinear interpolation between
// these is
//     sum of d[j][i] s_i(x) s_j(y),  s_0 = 1,  s_1(x) = x,  s_k(x) = min(x, k - 1)
// from the first texel to the last: no addresses, and no gathers, by the ray.
#pragma once
#include "rectangles.cl"
#include "samples.cl"

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

// Colours of a row of rays, whose coordinates lie within the patch.
inline Vec patch_row(const TexelPatch *p, global const Samples *samples, int at)
{
    const vf u = VLOAD(samples->of[COORDINATES] + at);
    const vf v = VLOAD(samples->of[COORDINATES + 1] + at);
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

// Blocks of more regions read their textures ray by ray: patches would not pay.
#define PATCHED_REGIONS 8

// Read the texels under what a block of few regions sees of a material.
inline void read_patch(const Scene *scene, const Block *b, int key, const Material *m,
                      TexelPatch *patch)
{
    const Level base = m->maps[MAP_BASE];
    patch->columns = 0;
    if (!TEXTURED || !base.height || OUTER > 1 || b->regions.count > PATCHED_REGIONS) return;
    float4 range = (float4)(FAR, FAR, -FAR, -FAR);
    for (int k = 0; k < b->regions.count; ++k) {
        global const PlaneEquations *p = b->equations + k;
        const Rectangle at = region_rectangle(b->regions.of + k, b->bundle.half_extent);
        if (p->key != key) continue;
        if (!(least_over(p->denominator, at) > 0.0f)) return;
        const float2 u = quotient_range(p->slot[COORDINATES], p->weights, at);
        const float2 v = quotient_range(p->slot[COORDINATES + 1], p->weights, at);
        range.lo = min(range.lo, (float2)(u.x, v.x));
        range.hi = max(range.hi, (float2)(u.y, v.y));
    }
    make_patch(scene->texels, base, range, patch);
}
