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

#endif
