// Baked light: what surfaces get from the sky and from one another, over pi; and the sky itself.
//
// Each side of a triangle has a grid of R cells along an edge, the points (i, j) with i + j <= R,
// row by row of j; i / R and j / R are the weights of its second and third corner.  Between points
// light is linear.  Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
#pragma once
#include "rectangles.cl"
#include "texture.cl"

// Add a share of the light at points.  A point has 9 bits per colour and an exponent.
inline Vec add_point(Vec sum, vu point, vf share)
{
    share *= AS_VF(AS_VI(point >> 27) + 103 << 23);
    const vu most = 511;
    const Vec colour = {TO_VF(point & most), TO_VF((point >> 9) & most),
                        TO_VF((point >> 18) & most)};
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

// Over so few cells light that differs from an affine function by less than such a share is one.
#define AFFINE_CELLS 6.0f
#define AFFINE_SHARE (1.0f / 256.0f)
// Light that is affine over a grid's cells: in its first corner, and steps per column and row.
typedef struct { float4 zero, x, y; } AffineLight;

inline float4 light_at(const Scene *s, int first, int i, int j, int side)
{
    const uint point = s->light[first + j * (2 * side + 3 - j) / 2 + i];
    const uint4 colour = (uint4)(point) >> (uint4)(0, 9, 18, 0) & (uint4)((uint3)(511), 0);
    return convert_float4(as_int4(colour)) * as_float(((int)(point >> 27) + 103) << 23);
}

// Whether the light is affine over the cells that a rectangle of rays sees.
inline int find_affine(const Scene *s, global const PlaneEquations *p, Rectangle at, AffineLight *l)
{
    const int side = p->grid[2];
    if (OUTER > 1 || !(least_over(p->denominator, at) > 0.0f)) return 0;
    const float2 x = side * quotient_range(p->slot[PLACE], p->weights, at);
    const float2 y = side * quotient_range(p->slot[PLACE + 1], p->weights, at);
    if (!(x.y - x.x < AFFINE_CELLS && y.y - y.x < AFFINE_CELLS)) return 0;
    const int i = clamp((int)x.x, 0, side - 1), j = clamp((int)y.x, 0, side - 1 - i);
    const int right = clamp((int)ceil(x.y), i + 1, side), down = clamp((int)ceil(y.y), j + 1, side);
    if (i + down > side || right + j > side) return 0;
    // The corners turn to the viewer where the weights are negative.
    const int first = p->grid[p->weights.of[ONE] > 0.0f];
    const float4 one = light_at(s, first, i, j, side);
    l->x = (light_at(s, first, right, j, side) - one) / (float)(right - i);
    l->y = (light_at(s, first, i, down, side) - one) / (float)(down - j);
    float4 low = 0.0f, high = 0.0f;
    float least = FAR;
    for (int row = j; row <= down; ++row) {
        for (int k = i; k <= min(right, side - row); ++k) {
            const float4 plane = one + (float)(k - i) * l->x + (float)(row - j) * l->y;
            const float4 light = light_at(s, first, k, row, side);
            low = min(low, light - plane);
            high = max(high, light - plane);
            least = min(least, most_of(light));
        }
        if (most_of(high - low) > 2.0f * AFFINE_SHARE * least) return 0;
    }
    l->zero = one - (float)i * l->x - (float)j * l->y + 0.5f * (low + high);
    return 1;
}

inline Vec affine_row(const AffineLight *l, vf x, vf y)
{
    return fma3(x, spread3(l->x.xyz), fma3(y, spread3(l->y.xyz), spread3(l->zero.xyz)));
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
    const Vec d = direction_row(r, row);
    Vec light;
    for (int k = 0; k < LANES; ++k) {
        const float3 along = ray_vector(&d, k);
        const float scale = 0.5f * side / (fabs(along.x) + fabs(along.y) + 1.0f);
        const float2 at = fma(along.xy, scale, 0.5f * side - 0.5f);
        set_ray_vector(&light, k, map_between(s->sky, side, at.x, at.y).xyz);
    }
    return light;
}
