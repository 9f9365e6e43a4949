// Baked light: what surfaces get from the sky and from one another, over pi; and the sky itself.
//
// Each side of a triangle has a grid of R cells along an edge, the points (i, j) with i + j <= R,
// row by row of j; i / R and j / R are the weights of its second and third corner.  Between points
// light is linear.  Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010.
#pragma once
#include "rectangles.cl"
#include "texture.cl"

inline vi grid_point(vi i, vi j, int side) { return j * (2 * side + 3 - j) / 2 + i; }

inline float4 light_at(const Scene *s, int first, int i, int j, int side)
{
    return vload4(first + j * (2 * side + 3 - j) / 2 + i, s->light);
}

// Whether all rays of a block see a triangle from one side.
inline int keeps_side(Affine denominator, float half_extent)
{
    float spread = half_extent * (fabs(denominator.of[X]) + fabs(denominator.of[Y]));
    if (OUTER > 1) spread += OUTER_HALF * (fabs(denominator.of[U]) + fabs(denominator.of[V]));
    return denominator.of[ONE] > BOUND_SLACK * spread + SIDE_SLACK * fabs(denominator.of[ONE]);
}

// The one cell of a grid that a rectangle of rays sees: its column and row, and 1 for the half
// beyond its diagonal; a negative column where there are several.
inline int3 seen_cell(global const PlaneEquations *p, Rectangle at, int side)
{
    if (side == 1) return 0;
    const int3 several = -1;
    if (OUTER > 1) return several;
    const float2 most = (float2)(side);
    const float2 x = clamp(quotient_range(p->light[1], p->weights, at) * most, 0.0f, most);
    const float2 y = clamp(quotient_range(p->light[2], p->weights, at) * most, 0.0f, most);
    const int i = min((int)x.x, side - 1), j = min((int)y.x, side - 1);
    if (!(x.y <= i + 1 && y.y <= j + 1 && i + j < side)) return several;
    const int rest = side - 1 - i - j;
    const float2 z = quotient_range(p->light[0], p->weights, at) * most;
    if (rest == 0 || z.x >= rest) return (int3)(i, j, 0);
    return z.y <= rest ? (int3)(i, j, 1) : several;
}

// Where a region sees one cell: the light as a function over the block, in place of the weights.
inline void set_up_light(const Scene *s, const Bundle *r, global const Region *region,
                         global PlaneEquations *p)
{
    const int3 grid = vload3(region->triangle, s->grids);
    const int side = grid.z;
    const Rectangle at = region_rectangle(region, r->half_extent);
    p->grid[0] = grid.x;
    p->grid[1] = grid.y;
    p->grid[2] = side;
    if (!keeps_side(p->denominator, r->half_extent)) return;
    const int3 cell = seen_cell(p, at, side);
    if (cell.x < 0) return;
    // The corners turn to the viewer where the weights are negative.
    const int front = (p->weights.of[ONE] < 0.0f) == (p->denominator.of[ONE] > 0.0f);
    const int first = front ? grid.x : grid.y, i = cell.x, j = cell.y, far = cell.z;
    const float4 along = light_at(s, first, i + 1, j, side);
    const float4 up = light_at(s, first, i, j + 1, side);
    const float4 one = light_at(s, first, i + far, j + far, side);
    // The steps per column and row, and the light in the grid's three corners.
    const float4 x = far ? one - up : along - one, y = far ? one - along : up - one;
    const float4 zero = one - (float)(i + far) * x - (float)(j + far) * y;
    const float4 of[3] = {zero, zero + (float)side * x, zero + (float)side * y};
    for (int k = 0; k < AFFINE_TERMS; ++k) {
        const float a = p->light[0].of[k], b = p->light[1].of[k], c = p->light[2].of[k];
        const float4 sum = a * of[0] + b * of[1] + c * of[2];
        p->light[0].of[k] = sum.x;
        p->light[1].of[k] = sum.y;
        p->light[2].of[k] = sum.z;
    }
    p->grid[2] = 0;
}

// The light on a row of rays that see a triangle.
inline Vec baked_row(const Scene *s, global const PlaneEquations *p, Row at)
{
    const vf weights = plane_row(p->weights, at), inverse = reciprocal(weights);
    const int side = p->grid[2];
    Vec c = {edge_row(p->light[0], at), edge_row(p->light[1], at), edge_row(p->light[2], at)};
    c = scale3(c, inverse);
    if (!side) return c;
    const vf x = c.y * (float)side, y = c.z * (float)side;
    // NaN outside a mask must not become an address.
    const vi i = clamp(TO_VI(x), (vi)(0), (vi)(side - 1));
    const vi j = clamp(TO_VI(y), (vi)(0), side - 1 - i);
    const vf f = x - TO_VF(i), g = y - TO_VF(j);
    const vi far = GT(f + g, (vf)(1.0f)) & LT(i + j, (vi)(side - 1));
    const vi first = pick_int((vi)(p->grid[1]), (vi)(p->grid[0]), LT(weights, (vf)(0.0f)));
    private int points[3][LANES];
    private float shares[3][LANES];
    RayVectors light;
    VSTORE(first + grid_point(i - far, j - far, side), points[0]);
    VSTORE(first + grid_point(i + 1, j, side), points[1]);
    VSTORE(first + grid_point(i, j + 1, side), points[2]);
    VSTORE(pick(1.0f - f - g, f + g - 1.0f, far), shares[0]);
    VSTORE(pick(f, 1.0f - g, far), shares[1]);
    VSTORE(pick(g, 1.0f - f, far), shares[2]);
    for (int k = 0; k < LANES; ++k) {
        float4 sum = 0.0f;
        for (int n = 0; n < 3; ++n) sum += shares[n][k] * vload4(points[n][k], s->light);
        set_ray_vector(&light, k, sum.xyz);
    }
    return row_of(&light);
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
