// One ray against LANES triangles at once.
//
// The triangle test is that of S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle
// Intersection", JCGT 2(1), 2013.  Corners are sheared onto the ray in float32; where the device
// has doubles, the edge functions are formed in them, and a difference of two products of floats is
// then rounded once, so that its sign is exact and nothing leaks, at edges or at vertices.
#pragma once
#include "sweep.cl"

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define WIDE_TYPE double
#else
#define WIDE_TYPE float
#endif
typedef WIDE(WIDE_TYPE) vd;
#define TO_VD WIDE(JOIN(convert_, WIDE_TYPE))
#define VD_MASK(m) TO_VI(MASK(m))

typedef struct {
    float3 origin, direction;  // direction scaled to a largest component in [1, 2)
    Sweep path;                // of its origin
    int kx, ky, kz;            // axes, the last along the largest component of the direction
    float sx, sy, sz;          // shear onto that axis
} Ray;

// A ray of any length; its parameter is 2^exponent times that of the direction as given.
inline Ray scaled_ray(float3 origin, float3 direction, int *exponent)
{
    Ray r;
    *exponent = ilogb(largest_component(direction));
    direction = ldexp(direction, (int3)(-*exponent));
    r.origin = origin;
    r.direction = direction;
    r.kz = largest_axis(direction);
    r.kx = (r.kz + 1) % 3;
    r.ky = (r.kz + 2) % 3;
    r.sz = 1.0f / axis(direction, r.kz);
    r.sx = axis(direction, r.kx) * r.sz;
    r.sy = axis(direction, r.ky) * r.sz;
    r.path = make_sweep(origin, origin, direction, direction);
    return r;
}

// LANES triangles in a ray's frame: corners, edges and their sum, which are hit, and when.
typedef struct {
    Triple x, y, z;
    vd e[3], sum;
    vi mask;
    vf time;
} Sheared;

// The ray is the origin of x and y: it misses a triangle whose bounding box does not hold that.
inline vi hold_origin(Triple a)
{
    return LE(least3(a), (vf)(0.0f)) & GE(most3(a), (vf)(0.0f));
}

inline void shear_leaf(const Ray *r, global const Leaf *leaf, Sheared *s)
{
    const float ox = axis(r->origin, r->kx), oy = axis(r->origin, r->ky);
    const float oz = axis(r->origin, r->kz);
    for (int k = 0; k < 3; ++k) {
        const vf z = VLOAD(leaf->corner[k][r->kz]) - oz;
        s->x.of[k] = fma(-z, (vf)(r->sx), VLOAD(leaf->corner[k][r->kx]) - ox);
        s->y.of[k] = fma(-z, (vf)(r->sy), VLOAD(leaf->corner[k][r->ky]) - oy);
        s->z.of[k] = z;
    }
    s->mask = hold_origin(s->x) & hold_origin(s->y);
    if (!row_any(s->mask)) return;
    for (int k = 0; k < 3; ++k) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        s->e[k] = TO_VD(s->x.of[a]) * TO_VD(s->y.of[b]) - TO_VD(s->y.of[a]) * TO_VD(s->x.of[b]);
    }
    s->sum = s->e[0] + s->e[1] + s->e[2];
    const vd zero = 0;
    s->mask &= VD_MASK(((s->e[0] >= zero) & (s->e[1] >= zero) & (s->e[2] >= zero)) |
                       ((s->e[0] <= zero) & (s->e[1] <= zero) & (s->e[2] <= zero)));
    s->mask &= VD_MASK(s->sum != zero);
    if (!row_any(s->mask)) return;
    vd depth = 0;
    for (int k = 0; k < 3; ++k) depth += s->e[k] * TO_VD(s->z.of[k]);
    s->time = TO_VF(depth / s->sum) * r->sz;
    s->mask &= GT(s->time, (vf)(0.0f));
}
