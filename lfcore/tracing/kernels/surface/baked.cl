// Baked light: what surfaces get from the sky and from one another, over pi; and the sky itself.
//
// Each side of a triangle has a grid of R cells along an edge, the points (i, j) with i + j <= R,
// row by row of j; i / R and j / R are the weights of its second and third corner.  Between points
// light is linear.  Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
#pragma once
#include "texture.cl"

// Add a share of the light at points.  A point has 9 bits per colour and an exponent.
inline Vec add_point(Vec sum, vu point, vf share)
{
    share *= AS_VF(AS_VI(point >> 27) + 103 << 23);
    const vu most = 511;
    const Vec colour = {TO_VF(point & most), TO_VF((point >> 9) & most), TO_VF((point >> 18) & most)};
    return fma3(share, colour, sum);
}

// The light on a row of rays at columns x and rows y of grids.
inline Vec baked_row(const Scene *s, vf x, vf y, vi first, vi side)
{
    // NaN outside a mask must not become an address.
    const vi i = clamp(TO_VI(x), (vi)(0), side - 1), j = clamp(TO_VI(y), (vi)(0), side - 1 - i);
    const vf f = x - TO_VF(i), g = y - TO_VF(j);
    const vi far = GT(f + g, (vf)(1.0f)) & LT(i + j, side - 1);
    const vi along = first + j * (2 * side + 3 - j) / 2 + i, up = along + side + 1 - j;
    Vec sum = {0.0f, 0.0f, 0.0f};
    sum = add_point(sum, fetch(s->light, pick_int(along, up + 1, far)),
                    pick(1.0f - f - g, f + g - 1.0f, far));
    sum = add_point(sum, fetch(s->light, along + 1), pick(f, 1.0f - g, far));
    return add_point(sum, fetch(s->light, up), pick(g, 1.0f - f, far));
}

// A map (side, side, 4) between texels.
inline float4 map_between(global const float *map, int side, float x, float y)
{
    const int i = clamp((int)x, 0, side - 2), j = clamp((int)y, 0, side - 2);
    const float f = x - i, g = y - j;
    global const float *texel = map + 4 * (j * side + i), *below = texel + 4 * side;
    const float4 top = vload4(0, texel) + f * (vload4(1, texel) - vload4(0, texel));
    const float4 end = vload4(0, below) + f * (vload4(1, below) - vload4(0, below));
    return top + g * (end - top);
}

// The sky that a row of rays sees.  Its map is an octahedron's, in which a direction d of the
// camera's space, forward, is at d.xy over the sum of its components' sizes.
inline Vec sky_row(const Scene *s, const Bundle *r, Row row)
{
    const int side = s->numbers->sky_side;
    const RayVectors d = by_ray(direction_row(r, row));
    RayVectors light;
    for (int k = 0; k < LANES; ++k) {
        const float3 along = ray_vector(&d, k);
        const float scale = 0.5f * side / (fabs(along.x) + fabs(along.y) + 1.0f);
        const float2 at = fma(along.xy, scale, 0.5f * side - 0.5f);
        set_ray_vector(&light, k, map_between(s->sky, side, at.x, at.y).xyz);
    }
    return row_of(&light);
}
