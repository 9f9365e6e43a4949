// Baked light: the irradiance of surfaces by the sky and by other surfaces, over pi.
//
// Each side of a triangle has a grid of R cells along an edge, the points (i, j) with i + j <= R,
// row by row of j; i / R and j / R are the weights of its second and third corner.  Between points
// light is linear.  Grids of half the cells follow, as long as R is even.  Source: C. Yuksel, J.
// Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
#pragma once
#include "texture.cl"

// Add a share of the light at points.  A point has BAKED_BITS per channel and an exponent.
inline Vec add_point(Vec sum, vu point, vf share)
{
    const vi exponent = AS_VI(point >> 3 * BAKED_BITS) - BAKED_BITS - BAKED_BIAS;
    share *= AS_VF(exponent + FLOAT_BIAS << FRACTION_BITS);
    const vu most = (1 << BAKED_BITS) - 1;
    const Vec colour = {TO_VF(point & most), TO_VF((point >> BAKED_BITS) & most),
                        TO_VF((point >> 2 * BAKED_BITS) & most)};
    return fma3(share, colour, sum);
}

// The light on a row of rays at columns x and rows y of grids.
inline Vec baked_row(const Scene *s, vf x, vf y, vi first, vi side)
{
    // NaN outside a mask must not become an address.
    const vi i = clamp(TO_VI(x), (vi)(0), side - 1), j = clamp(TO_VI(y), (vi)(0), side - 1 - i);
    const vf f = x - TO_VF(i), g = y - TO_VF(j);
    const vi upper = GT(f + g, (vf)(1.0f)) & LT(i + j, side - 1);
    const vi along = first + j * (2 * side + 3 - j) / 2 + i, up = along + side + 1 - j;
    Vec sum = {0.0f, 0.0f, 0.0f};
    sum = add_point(sum, fetch(s->baked_light, pick_int(along, up + 1, upper)),
                    pick(1.0f - f - g, f + g - 1.0f, upper));
    sum = add_point(sum, fetch(s->baked_light, along + 1), pick(f, 1.0f - g, upper));
    return add_point(sum, fetch(s->baked_light, up), pick(g, 1.0f - f, upper));
}
