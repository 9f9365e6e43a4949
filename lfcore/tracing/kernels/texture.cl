// Textures: bilinear, wrapping, in linear light, from one buffer of packed texels.
//
// A texel holds the square roots of its three linear values in 10 bits each: one load, one multiply
// a channel to decode, and steps no coarser than those of 8-bit sRGB.
#ifndef LFCORE_TEXTURE_CL
#define LFCORE_TEXTURE_CL
#include "lanes.cl"

typedef struct { vf r, g, b; } Colour;

inline vu fetch(global const uint *texels, vi index)
{
#if LANES == 1
    return texels[index];
#else
    private int at[LANES];
    private uint texel[LANES];
    VSTORE(index, at);
    for (int k = 0; k < LANES; ++k) texel[k] = texels[at[k]];
    return VLOAD(texel);
#endif
}

inline void add_texel(Colour *sum, vu texel, vf weight)
{
    const vf r = TO_VF(texel & 1023u), g = TO_VF((texel >> 10) & 1023u), b = TO_VF(texel >> 20);
    sum->r = fma(r * r, weight, sum->r);
    sum->g = fma(g * g, weight, sum->g);
    sum->b = fma(b * b, weight, sum->b);
}

// Wrap into [0, size) given x in [-1, size].
inline vi wrap(vi x, int size)
{
    x = pick_int(x, x + size, LT(x, (vi)(0)));
    return pick_int(x, x - size, GE(x, (vi)(size)));
}

// `image` is (offset, width, height) of one mip level; v runs up, row 0 is on top.
inline Colour sample_texture(global const uint *texels, int4 image, vf u, vf v)
{
    const vf x = fma(u - floor(u), (vf)(image.y), (vf)(-0.5f)), y = fma(1.0f - (v - floor(v)), (vf)(image.z), (vf)(-0.5f));
    const vf left = floor(x), top = floor(y), fx = x - left, fy = y - top;
    // NaN outside a mask must not become an address.
    const vi x0 = clamp(TO_VI(left), (vi)(-1), (vi)(image.y)), y0 = clamp(TO_VI(top), (vi)(-1), (vi)(image.z));
    const vi xa = wrap(x0, image.y), xb = wrap(x0 + 1, image.y);
    const vi ya = wrap(y0, image.z) * image.y + image.x, yb = wrap(y0 + 1, image.z) * image.y + image.x;
    const vf scale = 1.0f / (1023.0f * 1023.0f);
    const vf wy = fy * scale, vy = (1.0f - fy) * scale;
    Colour sum = {0.0f, 0.0f, 0.0f};
    add_texel(&sum, fetch(texels, ya + xa), (1.0f - fx) * vy);
    add_texel(&sum, fetch(texels, ya + xb), fx * vy);
    add_texel(&sum, fetch(texels, yb + xa), (1.0f - fx) * wy);
    add_texel(&sum, fetch(texels, yb + xb), fx * wy);
    return sum;
}

// The few texels that a block of rays on one triangle falls into: bilinear interpolation between them is
//     sum of d[j][i] s_i(x) s_j(y),  s_0 = 1,  s_k(x) = x - (k - 1) clamped to [0, 1],
// with d the differences of the texels along both axes: no addresses, and no gathers, by the ray.
#define PATCH 5
#define SMALL_PATCH 3
typedef struct {
    int columns, rows;         // texels; 0 where there are too many
    float u, v, left, top;     // whole numbers: turns of the texture, and the first texel within it
    float width, height;
    float d[PATCH][PATCH][3];  // zero beside the texels, as far as a small patch goes
} Patch;

// The patch of rays whose coordinates lie within [u0, u1] x [v0, v1].
inline void make_patch(global const uint *texels, int4 image, float u0, float u1, float v0, float v1, Patch *p)
{
    p->columns = 0;
    p->u = floor(u0); p->v = floor(v1);
    p->width = image.y; p->height = image.z;
    p->left = floor(fma(u0 - p->u, p->width, -0.5f)); p->top = floor(fma(1.0f - (v1 - p->v), p->height, -0.5f));
    const float across = fma(u1 - p->u, p->width, -0.5f) - p->left, down = fma(1.0f - (v0 - p->v), p->height, -0.5f) - p->top;
    if (!(across < PATCH - 1 && down < PATCH - 1)) return;
    p->columns = (int)across + 2;
    p->rows = (int)down + 2;
    for (int j = 0; j < SMALL_PATCH; ++j)
        for (int i = 0; i < SMALL_PATCH; ++i)
            for (int k = 0; k < 3; ++k) p->d[j][i][k] = 0.0f;
    const int first = p->left < 0.0f ? image.y - 1 : (int)p->left;
    int line = p->top < 0.0f ? image.z - 1 : (int)p->top;
    for (int j = 0; j < p->rows; ++j, line = line + 1 < image.z ? line + 1 : 0)
        for (int i = 0, column = first; i < p->columns; ++i, column = column + 1 < image.y ? column + 1 : 0) {
            const uint texel = texels[image.x + line * image.y + column];
            for (int k = 0; k < 3; ++k) {
                const float root = (float)(texel >> 10 * k & 1023u) * (1.0f / 1023.0f);
                p->d[j][i][k] = root * root;
            }
        }
    for (int j = p->rows - 1; j >= 0; --j)
        for (int i = p->columns - 1; i >= 0; --i)
            for (int k = 0; k < 3; ++k) {
                if (i) p->d[j][i][k] -= p->d[j][i - 1][k];
                if (j) p->d[j][i][k] -= p->d[j - 1][i][k] - (i ? p->d[j - 1][i - 1][k] : 0.0f);
            }
}

// The patch's colour at places in texels, counted from the centre of its first one; `columns` and `rows` are at least its
// own.
inline Colour mix_texels(const Patch *p, int columns, int rows, vf x, vf y)
{
    vf s[PATCH];
    for (int i = 1; i < columns; ++i) s[i] = clamp(x - (float)(i - 1), (vf)(0.0f), (vf)(1.0f));
    Colour sum;
    for (int j = 0; j < rows; ++j) {
        const float (*d)[3] = p->d[j];
        Colour row = {d[0][0], d[0][1], d[0][2]};
        for (int i = 1; i < columns; ++i) {
            row.r = fma(s[i], (vf)(d[i][0]), row.r);
            row.g = fma(s[i], (vf)(d[i][1]), row.g);
            row.b = fma(s[i], (vf)(d[i][2]), row.b);
        }
        const vf t = clamp(y - (float)(j - 1), (vf)(0.0f), (vf)(1.0f));
        if (j) { sum.r = fma(t, row.r, sum.r); sum.g = fma(t, row.g, sum.g); sum.b = fma(t, row.b, sum.b); }
        else sum = row;
    }
    return sum;
}

// Most patches are small, and sampled without loops.
inline Colour mix_patch(const Patch *p, vf x, vf y)
{
    if (max(p->columns, p->rows) <= SMALL_PATCH) return mix_texels(p, SMALL_PATCH, SMALL_PATCH, x, y);
    return mix_texels(p, p->columns, p->rows, x, y);
}

inline Colour sample_patch(const Patch *p, vf u, vf v)
{
    return mix_patch(p, fma(u - p->u, (vf)(p->width), (vf)(-0.5f)) - p->left, fma(1.0f - (v - p->v), (vf)(p->height), (vf)(-0.5f)) - p->top);
}

#endif
