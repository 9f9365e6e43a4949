// Vectors of one ray, and rows of rays taken apart.
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

// The unit vector along a, whose squares may overflow or underflow; 0 along 0.
inline float largest_component(float3 a) { return max(fabs(a.x), max(fabs(a.y), fabs(a.z))); }
inline float3 direction_of(float3 a)
{
    a /= max(largest_component(a), LEAST_LENGTH);
    return a / max(sqrt(inner_product(a, a)), LEAST_LENGTH);
}

// A row of vectors, ray by ray.
typedef struct { float of[3][LANES]; } RayVectors;

inline RayVectors by_ray(Vec a)
{
    RayVectors v;
    VSTORE(a.x, v.of[0]);
    VSTORE(a.y, v.of[1]);
    VSTORE(a.z, v.of[2]);
    return v;
}
inline Vec row_of(const RayVectors *v)
{
    return (Vec){VLOAD(v->of[0]), VLOAD(v->of[1]), VLOAD(v->of[2])};
}
inline float3 ray_vector(const RayVectors *v, int k)
{
    return (float3)(v->of[0][k], v->of[1][k], v->of[2][k]);
}
inline void set_ray_vector(RayVectors *v, int k, float3 a)
{
    v->of[0][k] = a.x;
    v->of[1][k] = a.y;
    v->of[2][k] = a.z;
}
