// Rectangles around the rays of a region, in blocks of one element.
#pragma once
#include "equations.cl"

// The rectangle around the region's rays, in a block of `half_extent`.
inline Rectangle region_rectangle(global const Region *r, float half_extent)
{
    const float left = lowest((uint)r->columns), right = 31 - clz((uint)r->columns);
    const float top = r->top, bottom = r->bottom;
    return (Rectangle){0.5f * (left + right) - half_extent, 0.5f * (top + bottom) - half_extent,
                       0.5f * (right - left), 0.5f * (bottom - top)};
}

// A lower bound of an affine function at all rays in a rectangle.
inline float least_over(Affine f, Rectangle at)
{
    const float x = at.x * f.term[X], y = at.y * f.term[Y], one = f.term[ONE];
    const float error = SIDE_SLACK * (fabs(one) + fabs(x) + fabs(y));
    const float spread = at.half_width * fabs(f.term[X]) + at.half_height * fabs(f.term[Y]);
    return one + x + y - (error + BOUND_SLACK * spread);
}
