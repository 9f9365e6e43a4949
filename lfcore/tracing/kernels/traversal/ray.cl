// One ray against LANES triangles at once.
//
// The triangle test is that of S. Woop, C. Benthin, I. Wald, "Watertight Ray/Triangle
// Intersection", JCGT 2(1), 2013.  Corners are sheared onto the ray in float32.  If the device has
// doubles, edge functions use them: a difference of two products of floats is then rounded once, so
// that its sign is exact and no ray leaks at edges or vertices.
#pragma once
#include "sweep.cl"

#ifdef cl_khr_fp64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#define WIDE_TYPE double
#else
#define WIDE_TYPE float
#endif

typedef struct {
    float3 origin, direction;  // direction scaled to a largest component in [1, 2)
    Sweep path;                // the moving box of its origin
    int kx, ky, kz;            // axes, the last along the largest component of the direction
    float ox, oy, oz;          // the origin along these
    float sx, sy, sz;          // shear onto the last
} Ray;

// a 2^power, for powers from -252 to 254.
inline float3 times_power(float3 a, int power)
{
    const int part = FLOAT_BIAS + power / 2, rest = 2 * FLOAT_BIAS + power - part;
    return a * as_float(part << FRACTION_BITS) * as_float(rest << FRACTION_BITS);
}

// A ray of any length; its parameter is 2^exponent times that of the given direction.
inline Ray scaled_ray(float3 origin, float3 direction, int *exponent)
{
    Ray r;
    *exponent = ilogb(largest_component(direction));
    direction = times_power(direction, -*exponent);
    const float o[3] = {origin.x, origin.y, origin.z};
    const float d[3] = {direction.x, direction.y, direction.z};
    r.origin = origin;
    r.direction = direction;
    r.kz = largest_axis(direction);
    r.kx = (r.kz + 1) % 3;
    r.ky = (r.kz + 2) % 3;
    r.ox = o[r.kx];
    r.oy = o[r.ky];
    r.oz = o[r.kz];
    r.sz = 1.0f / d[r.kz];
    r.sx = d[r.kx] * r.sz;
    r.sy = d[r.ky] * r.sz;
    r.path = make_sweep(origin, origin, direction, direction);
    return r;
}

// Twice the edge functions at a ray of triangles with corners at (x, y) beside it, and a bound of
// those with a wrong sign.
inline Triple ray_edges(const Triple *x, const Triple *y, vf *error)
{
    Triple part, e;
    for (int k = 0; k < 3; ++k) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        part.corner[k] = y->corner[a] * x->corner[b];
        e.corner[k] = fma(x->corner[a], y->corner[b], -part.corner[k]);
    }
    *error = fma(largest3(part), (vf)(RAY_EDGE_ERROR), (vf)(NOTHING_LEFT));
    return e;
}

// Bits of the triangles of a leaf that a ray may hit before `far`, in float32.  A triangle is
// missed if two of its edge functions have opposite signs and exceed their rounding errors.
inline uint may_hit(const Ray *r, global const Leaf *leaf, float far)
{
    vi hits = 0;
    for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
        Triple x, y, time;
        for (int k = 0; k < 3; ++k) {
            const vf z = VLOAD(leaf->corner[k][r->kz] + lane) - r->oz;
            x.corner[k] = fma(-z, (vf)(r->sx), VLOAD(leaf->corner[k][r->kx] + lane) - r->ox);
            y.corner[k] = fma(-z, (vf)(r->sy), VLOAD(leaf->corner[k][r->ky] + lane) - r->oy);
            time.corner[k] = z * r->sz;
        }
        vf error;
        const Triple e = ray_edges(&x, &y, &error);
        const vi beside = LT(least3(e), -error) & GT(most3(e), error);
        const vi may = LE(least3(x), (vf)(0.0f)) & GE(most3(x), (vf)(0.0f)) & ~beside &
                       GE(most3(time), (vf)(0.0f)) & LE(least3(time), (vf)(far));
        hits |= may & (LANE_BITS << lane);
    }
    return row_any(hits) ? (uint)row_or(hits) : 0;
}

// A triangle beside a ray, its corners along the ray's axes, and twice its edge functions.
typedef struct { WIDE_TYPE x[3], y[3], z[3], e[3]; } Beside;

// A triangle whose corners' coordinates, `corners` (3, 3), are `pitch` numbers apart.
inline Beside triangle_beside(const Ray *r, global const float *corners, int pitch)
{
    Beside b;
    for (int k = 0; k < 3; ++k, corners += 3 * pitch) {
        const float depth = corners[r->kz * pitch] - r->oz;
        b.x[k] = fma(-depth, r->sx, corners[r->kx * pitch] - r->ox);
        b.y[k] = fma(-depth, r->sy, corners[r->ky * pitch] - r->oy);
        b.z[k] = depth;
    }
    for (int k = 0; k < 3; ++k) {
        const int p = (k + 1) % 3, q = (k + 2) % 3;
        b.e[k] = b.x[p] * b.y[q] - b.y[p] * b.x[q];
    }
    return b;
}

inline Beside leaf_beside(const Ray *r, global const Leaf *leaf, int at)
{
    return triangle_beside(r, leaf->corner[0][0] + at, NODE_WIDTH);
}

// The parameter of a ray on a triangle's plane, and the corners' weights there; false for a triangle
// that is seen edge-on.
inline int meets_plane(const Ray *r, const Beside *b, float *time, float3 *weights)
{
    const WIDE_TYPE sum = b->e[0] + b->e[1] + b->e[2];
    if (sum == 0) return 0;
    *time = (float)((b->e[0] * b->z[0] + b->e[1] * b->z[1] + b->e[2] * b->z[2]) / sum) * r->sz;
    const float first = b->e[0] / sum, second = b->e[1] / sum;
    *weights = (float3)(first, second, 1.0f - first - second);
    return 1;
}

// Whether a ray hits a triangle of a leaf; its parameter there, and the corners' weights.
inline int hits_triangle(const Ray *r, global const Leaf *leaf, int at, float *time,
                         float3 *weights)
{
    const Beside b = leaf_beside(r, leaf, at);
    const WIDE_TYPE *y = b.y, *e = b.e;
    if (min(e[0], min(e[1], e[2])) < 0 && max(e[0], max(e[1], e[2])) > 0) return 0;
    // Without doubles, the edge functions of a triangle that is seen edge-on are rounding errors.
    if (sizeof(e[0]) == 4 && (min(y[0], min(y[1], y[2])) > 0 || max(y[0], max(y[1], y[2])) < 0))
        return 0;
    return meets_plane(r, &b, time, weights) && *time > 0.0f;
}

// Whether a ray that hits a triangle also does so when it is moved along x, and along y by much
// less: of triangles with a common edge or corner, as many are crossed as by a ray beside it.
inline int crosses_triangle(const Ray *r, global const Leaf *leaf, int at)
{
    const Beside b = leaf_beside(r, leaf, at);
    const int positive = b.e[0] + b.e[1] + b.e[2] > 0;
    for (int k = 0; k < 3; ++k) {
        const int p = (k + 1) % 3, q = (k + 2) % 3;
        const WIDE_TYPE change = b.y[p] != b.y[q] ? b.y[p] - b.y[q] : b.x[q] - b.x[p];
        if ((b.e[k] != 0 ? b.e[k] > 0 : change > 0) != positive) return 0;
    }
    return 1;
}
