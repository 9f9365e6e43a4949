// sRGB encoding, ray by ray or for a whole block at once, or PQ where PEAK is the linear light of
// the brightest code, and not 0.
#pragma once
#include "block.cl"
#include "powers.cl"

// IEC 61966-2-1 encoding of values clamped to [0, 1]: a polynomial (least largest error, 7e-6) in
// the fourth root.
#define LINEAR_END 0.0031308f
// As good as black: 12.92 times it is three millionths of a code of 8 bits.  Roots of less would be
// those of denormal numbers.
#define BLACK 1.0e-9f
inline vf encode_srgb(vf x)
{
    x = clamp(x, (vf)(BLACK), (vf)(1.0f));
    const vf square = sqrt(x), root = sqrt(square);
    const vf high = fma(root, (vf)(-6.814727000e-02f), (vf)(2.895329352e-01f));
    const vf middle = fma(root, (vf)(-5.774826995e-01f), (vf)(1.255404424e+00f));
    const vf low = fma(root, (vf)(1.620262543e-01f), (vf)(-6.134021422e-02f));
    const vf p = fma(fma(high, square, middle), square, low);
    return pick(12.92f * x, p, GT(x, (vf)(LINEAR_END)));
}

// Chebyshev nodes of the third degree: cos(pi / 8) and cos(3 pi / 8).
#define NODE_A 0.9238795325f
#define NODE_B 0.3826834324f

// The encoding over a block in each colour, where the brightest ray is at most RANGE times the
// darkest: a cubic through four Chebyshev nodes, off by 0.02 of a code of 8 bits at most, 0.01 of
// one of 10, 0.03 of one of 12. Source: L. N. Trefethen, "Approximation Theory and Approximation
// Practice", 2013, chapter 3.
#define RANGE (BITS == 8 ? 2.0f : 1.5f)
// Narrower than this share of the middle coefficients would cancel.
#define NARROWEST 0.05f
typedef struct { float4 c[4]; } CubicEncoding;  // coefficients of red, green and blue, and nothing

// False where colours vary more than RANGE, are clamped or very dark.
inline int make_cubic(global const float *colours, CubicEncoding *e)
{
    Ranges ranges;
    clear_ranges(&ranges);
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        add_to_ranges(&ranges, load3(colours, at), (vi)(-1));
    const Box box = box_of(&ranges);
    const float4 from = (float4)(vload3(0, box.lo), 1.0f), to = (float4)(vload3(0, box.hi), 1.0f);
    if (PEAK > 0 || !all(from.xyz > LINEAR_END && to.xyz <= RANGE * from.xyz && to.xyz < 1.0f))
        return 0;
    const float4 middle = 0.5f * (from + to);
    const float4 half_width = max(0.5f * (to - from), NARROWEST * middle);
    private float nodes[16];
    vstore4(middle + NODE_A * half_width, 0, nodes);
    vstore4(middle + NODE_B * half_width, 1, nodes);
    vstore4(middle - NODE_B * half_width, 2, nodes);
    vstore4(middle - NODE_A * half_width, 3, nodes);
    for (int at = 0; at < 16; at += LANES) VSTORE(encode_srgb(VLOAD(nodes + at)), nodes + at);
    const float4 n0 = vload4(0, nodes), n1 = vload4(1, nodes), n2 = vload4(2, nodes);
    const float4 n3 = vload4(3, nodes), outer = n0 - n3, inner = n1 - n2;
    const float4 f0 = 0.25f * ((n0 + n3) + (n1 + n2));
    const float4 f1 = 0.5f * (NODE_A * outer + NODE_B * inner);
    const float4 f2 = 0.3535533906f * ((n0 + n3) - (n1 + n2));
    const float4 f3 = 0.5f * (NODE_B * outer - NODE_A * inner);
    // The same in place of (colour - middle) / half_width in the colour itself.
    const float4 scale = 1.0f / half_width, shift = -middle * scale;
    const float4 b = f1 - 3.0f * f3, c = 2.0f * f2, d = 4.0f * f3;
    e->c[0] = f0 - f2 + shift * (b + shift * (c + shift * d));
    e->c[1] = scale * (b + shift * (2.0f * c + shift * (3.0f * d)));
    e->c[2] = scale * scale * (c + shift * (3.0f * d));
    e->c[3] = scale * scale * scale * d;
    return 1;
}

inline vf cubic(vf t, float a, float b, float c, float d)
{
    return fma(fma(fma((vf)(d), t, (vf)(c)), t, (vf)(b)), t, (vf)(a));
}

// A row of colours encoded, by a cubic if there is one.
inline Vec encode_row(Vec c, const CubicEncoding *e)
{
    const float scale = 1.0f / (float)(PEAK);
    if (PEAK > 0) return (Vec){encode_pq(c.x, scale), encode_pq(c.y, scale), encode_pq(c.z, scale)};
    if (!e) return (Vec){encode_srgb(c.x), encode_srgb(c.y), encode_srgb(c.z)};
    return (Vec){cubic(c.x, e->c[0].x, e->c[1].x, e->c[2].x, e->c[3].x),
                 cubic(c.y, e->c[0].y, e->c[1].y, e->c[2].y, e->c[3].y),
                 cubic(c.z, e->c[0].z, e->c[1].z, e->c[2].z, e->c[3].z)};
}
