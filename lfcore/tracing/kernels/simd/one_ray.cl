// Vectors of one ray, boxes of rays, and single rays of a row.
#pragma once
#include "lanes.cl"

// A component of a vector by its number, and the number of the largest
inline float axis(float3 v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }
inline int largest_axis(float3 v)
{
    const float3 size = fabs(v);
    return size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
}

// In place of dot, cross, length and normalize, whose order and rounding each driver may choose.
inline float inner_product(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float3 cross_product(float3 a, float3 b)
{
    return (float3)(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

inline float largest_component(float3 a) { return max(fabs(a.x), max(fabs(a.y), fabs(a.z))); }

// The vector of ray `k` of a row.
inline float3 ray_vector(const Vec *row, int k)
{
    const float *at = (const float *)row + k;
    return (float3)(at[0], at[LANES], at[2 * LANES]);
}
inline void set_ray_vector(Vec *row, int k, float3 a)
{
    float *at = (float *)row + k;
    at[0] = a.x;
    at[LANES] = a.y;
    at[2 * LANES] = a.z;
}

// The least and the most of three quantities, over all rays and lane by lane.
typedef struct { float lo[3], hi[3]; } Box;
typedef struct { vf low[3], high[3]; } Ranges;

inline void clear_ranges(Ranges *r)
{
    for (int k = 0; k < 3; ++k) {
        r->low[k] = FAR;
        r->high[k] = -FAR;
    }
}

inline void add_to_ranges(Ranges *r, Vec a, vi mask)
{
    const vf x[3] = {a.x, a.y, a.z};
    for (int k = 0; k < 3; ++k) {
        r->low[k] = pick(r->low[k], min(r->low[k], x[k]), mask);
        r->high[k] = pick(r->high[k], max(r->high[k], x[k]), mask);
    }
}

// The box around all added points; without points, lo is above hi.
inline Box box_of(const Ranges *r)
{
    Box box;
    for (int k = 0; k < 3; ++k) {
        box.lo[k] = row_min(r->low[k]);
        box.hi[k] = row_max(r->high[k]);
    }
    return box;
}
