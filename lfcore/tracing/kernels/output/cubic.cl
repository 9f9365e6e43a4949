// Blocks whose colours vary little: their encoding is a cubic, in place of two square roots per ray
// and colour.
#pragma once
#include "frames.cl"
#include "one_ray.cl"

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
    const float node[4] = {NODE_A, NODE_B, -NODE_B, -NODE_A};
    for (int k = 0; k < 4; ++k) vstore4(middle + node[k] * half_width, k, nodes);
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
