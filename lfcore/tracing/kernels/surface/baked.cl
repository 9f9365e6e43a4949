// Baked light: the irradiance of surfaces by the sky and by other surfaces, over pi; and the sky.
//
// Each side of a triangle has a grid of R cells along an edge, the points (i, j) with i + j <= R,
// row by row of j; i / R and j / R are the weights of its second and third corner.  Between points
// light is linear.  Grids of half the cells follow, as long as R is even.  Source: C. Yuksel, J.
// Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
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
    const vi upper = GT(f + g, (vf)(1.0f)) & LT(i + j, side - 1);
    const vi along = first + j * (2 * side + 3 - j) / 2 + i, up = along + side + 1 - j;
    Vec sum = {0.0f, 0.0f, 0.0f};
    sum = add_point(sum, fetch(s->light, pick_int(along, up + 1, upper)),
                    pick(1.0f - f - g, f + g - 1.0f, upper));
    sum = add_point(sum, fetch(s->light, along + 1), pick(f, 1.0f - g, upper));
    return add_point(sum, fetch(s->light, up), pick(g, 1.0f - f, upper));
}

// Look up a row's baked light, which replaces the weights that locate it on grids.
inline void look_up_light(const Scene *s, SampleRow *row)
{
    const vf *at = row->value + WEIGHT;
    *vectors_at(row, BAKED_LIGHT) = baked_row(s, at[0], at[1], row->first, row->side);
}

// Light is taken for an affine function if it differs by less than this share.
#define AFFINE_SHARE (1.0f / 64.0f)
// Far below the infinite values of coarser levels where light is uneven.
#define UNEVEN_LIGHT 1024.0f
// The rays that sample a region to test whether its light is affine: 4 x 4 offsets from -1 to 1.
#define OFFSETS -1.0f, -1.0f / 3.0f, 1.0f / 3.0f, 1.0f
#define COLUMNS ((float16)(OFFSETS, OFFSETS, OFFSETS, OFFSETS))
#define ROWS COLUMNS.s048c159d26ae37bf

// The least cells per edge of a level: fewer are too coarse for the inside of a triangle.
#define LEAST_CELLS 8
// Find the light of these rays, colour by colour, at a level where they are at most one cell apart;
// false if there is no such level.
inline int light_of_lattice(const Scene *s, global const PlaneEquations *p, Rectangle r,
                            private float light[3][16])
{
    const Affine weight[3] = {p->weights, p->slot[SLOTS - 2], p->slot[SLOTS - 1]};
    const float2 u = quotient_range(weight[1], weight[0], r);
    const float2 v = quotient_range(weight[2], weight[0], r);
    const int finest = p->grid[2];
    const float cells = max(u.y - u.x, v.y - v.x) * finest / 3.0f;
    const int level = clamp((as_int(cells) >> 23) - 126, 0, 15), side = finest >> level;
    if (level && (side < LEAST_CELLS || side << level != finest)) return 0;
    // The corners turn to the viewer where the weights are negative.
    const int back = weight[0].term[ONE] > 0.0f;
    const int first = p->grid[back] + 2 * (finest * finest - side * side) / 3 +
        3 * (finest - side) + level;
    private float x[16], y[16];
    vstore16(fma(COLUMNS, r.half_width, r.x), 0, x);
    vstore16(fma(ROWS, r.half_height, r.y), 0, y);
    for (int k = 0; k < 16; k += LANES) {
        vf at[3];
        for (int i = 0; i < 3; ++i)
            at[i] = fma(VLOAD(y + k), (vf)(weight[i].term[Y]),
                        fma(VLOAD(x + k), (vf)(weight[i].term[X]), (vf)(weight[i].term[ONE])));
        const vf scale = (float)side * reciprocal(at[0]);
        const Vec c = baked_row(s, at[1] * scale, at[2] * scale, (vi)(first), (vi)(side));
        VSTORE(c.x, light[0] + k);
        VSTORE(c.y, light[1] + k);
        VSTORE(c.z, light[2] + k);
    }
    return 1;
}

// Fit the light of a region by an affine function of its rays, by least squares; false if the light
// is not affine.
inline int fit_light(const Scene *s, Rectangle r, global const PlaneEquations *p, Affine *light)
{
    private float samples[3][16];
    if (!(least_over(p->denominator, r) > 0.0f) || !light_of_lattice(s, p, r, samples)) return 0;
    float16 off = 0.0f;
    float sum = 0.0f, largest = 0.0f;
    for (int k = 0; k < 3; ++k) {
        const float16 all = vload16(0, samples[k]);
        const float4 c = all.s0123 + all.s4567 + all.s89ab + all.scdef;
        const float4 d = all.s048c + all.s159d + all.s26ae + all.s37bf;
        const float mean = (c.x + c.y + c.z + c.w) / 16.0f;
        const float along = 0.0375f * fma(3.0f, c.w - c.x, c.z - c.y);
        const float down = 0.0375f * fma(3.0f, d.w - d.x, d.z - d.y);
        off = max(off, fabs(all - fma(COLUMNS, along, fma(ROWS, down, mean))));
        sum += mean;
        largest = max(largest, mean + fabs(along) + fabs(down));
        const float right = along / max(r.half_width, 0.5f);
        const float below = down / max(r.half_height, 0.5f);
        light[k] = (Affine){{mean - r.x * right - r.y * below, right, below}};
    }
    const float8 most = max(off.lo, off.hi);
    return most_of(max(most.lo, most.hi)) <= AFFINE_SHARE / 3.0f * sum && largest < UNEVEN_LIGHT;
}

// Bilinear interpolation of a map (side, side, 4).
inline float4 map_between(global const float *map, int side, float x, float y)
{
    const int i = clamp((int)x, 0, side - 2), j = clamp((int)y, 0, side - 2);
    const float f = x - i, g = y - j;
    global const float *texel = map + 4 * (j * side + i), *below = texel + 4 * side;
    const float4 top = vload4(0, texel) + f * (vload4(1, texel) - vload4(0, texel));
    const float4 end = vload4(0, below) + f * (vload4(1, below) - vload4(0, below));
    return top + g * (end - top);
}

// The sky's radiance along a row of rays.  Its map is octahedral: a forward direction d in camera
// space is at d.xy / (|d.x| + |d.y| + |d.z|).
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
