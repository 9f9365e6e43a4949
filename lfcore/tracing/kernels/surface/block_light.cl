// Baked light over a block: an affine function of its rays, where the light is even.
#pragma once
#include "rectangles.cl"

// Light is taken for an affine function if it differs by less than this share.
#define AFFINE_SHARE (1.0f / 64.0f)
// Far below the infinite values of coarser levels where light is uneven.
#define UNEVEN_LIGHT 1024.0f
// The rays that sample a region to test whether its light is affine: 4 x 4 offsets from -1 to 1.
#define OFFSETS -1.0f, -1.0f / 3.0f, 1.0f / 3.0f, 1.0f
#define COLUMNS ((float16)(OFFSETS, OFFSETS, OFFSETS, OFFSETS))
#define ROWS COLUMNS.s048c159d26ae37bf

// The slope of a least-squares line through values at OFFSETS, whose squares sum to 20 / 9, with the
// mean of four values each: (3 (last - first) + third - second) times this.
#define LINE_SLOPE (3.0f / 80.0f)

// The least cells per edge of a level: fewer are too coarse for the inside of a triangle.
#define LEAST_CELLS 8
#define MOST_HALVINGS 15  // of a grid's cells
// Find the light of these rays, colour by colour, at a level where they are at most one cell apart;
// false if there is no such level.
inline int light_of_lattice(const Scene *s, global const PlaneEquations *p, Rectangle r,
                            private float light[3][16])
{
    const Affine weight[3] = {p->weights, p->slot[SLOTS - 2], p->slot[SLOTS - 1]};
    const float2 u = quotient_range(weight[1], weight[0], r);
    const float2 v = quotient_range(weight[2], weight[0], r);
    const int finest = p->grid[2];
    const float cells = max(u.y - u.x, v.y - v.x) * finest / 3.0f;  // from sample to sample
    const int halvings = (as_int(cells) >> FRACTION_BITS) - FLOAT_BIAS + 1;
    const int level = clamp(halvings, 0, MOST_HALVINGS), side = finest >> level;
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
        const float along = LINE_SLOPE * fma(3.0f, c.w - c.x, c.z - c.y);
        const float down = LINE_SLOPE * fma(3.0f, d.w - d.x, d.z - d.y);
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
