// Rays that are no bundle, one at a time through the same hierarchy: 16 boxes or triangles at once.
//
// The triangle test is that of Woop, Benthin and Wald, "Watertight Ray/Triangle Intersection", JCGT
// 2(1), 2013.  Corners are sheared onto the ray in float32; where the device has doubles the edge
// functions are formed in them, and a difference of two products of floats is then rounded once, so
// that its sign is exact and nothing leaks, at edges or at vertices.
#include "visibility.cl"

#if FP64
#pragma OPENCL EXTENSION cl_khr_fp64 : enable
#if LANES == 1
typedef double vd;
#define TO_VD convert_double
#define VD_TO_VF convert_float
#define VD_MASK(m) MASK(m)
#else
typedef JOIN(double, LANES) vd;
#define TO_VD JOIN(convert_double, LANES)
#define VD_TO_VF JOIN(convert_float, LANES)
#define VD_MASK(m) TO_VI(m)
#endif
#else
typedef vf vd;
#define TO_VD(x) (x)
#define VD_TO_VF(x) (x)
#define VD_MASK(m) MASK(m)
#endif

typedef struct {
    float3 origin, direction;   // direction scaled to a largest component in [1, 2)
    float3 inverse;             // 0 along an axis that the ray does not move on
    int kx, ky, kz;             // axes, the last along the largest component of the direction
    float sx, sy, sz;           // shear onto that axis
} Ray;

typedef struct { float t; int id; float3 weights; } Hit;

inline float axis(float3 v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }

inline Ray make_ray(float3 origin, float3 direction)
{
    Ray r;
    r.origin = origin;
    r.direction = direction;
    const float3 size = fabs(direction);
    r.kz = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    r.kx = (r.kz + 1) % 3;
    r.ky = (r.kz + 2) % 3;
    r.sz = 1.0f / axis(direction, r.kz);
    r.sx = axis(direction, r.kx) * r.sz;
    r.sy = axis(direction, r.ky) * r.sz;
    r.inverse = select(1.0f / direction, (float3)(0.0f), size < 1.0e-30f);
    return r;
}

// Interval of the ray within LANES boxes, conservative by the bound of Ize, "Robust BVH Ray Traversal",
// JCGT 2(2), 2013.
inline vi ray_meets(const Ray *r, global const float *boxes, float t_far)
{
    vf near = 0.0f, far = t_far;
    vi miss = 0;
    for (int k = 0; k < 3; ++k) {
        const float o = axis(r->origin, k), inverse = axis(r->inverse, k);
        const vf lo = VLOAD(boxes + k * NODE_WIDTH), hi = VLOAD(boxes + (3 + k) * NODE_WIDTH);
        if (inverse == 0.0f) {
            // 0 times infinity is no number: beside the slab or within it, all along.
            miss |= GT(lo, (vf)(o)) | LT(hi, (vf)(o));
            continue;
        }
        const vf a = (lo - o) * inverse, b = (hi - o) * inverse;
        near = max(near, min(a, b));
        far = min(far, max(a, b) * 1.0000004f);
    }
    return LE(near, far) & LE(VLOAD(boxes), VLOAD(boxes + 3 * NODE_WIDTH)) & ~miss;
}

inline void ray_leaf(const Ray *r, global const float *leaf, global const int *ids, Hit *hit)
{
    const float ox = axis(r->origin, r->kx), oy = axis(r->origin, r->ky), oz = axis(r->origin, r->kz);
    vf x[3], y[3], z[3];
    for (int k = 0; k < 3; ++k) {
        z[k] = VLOAD(leaf + (3 * k + r->kz) * NODE_WIDTH) - oz;
        x[k] = fma(-z[k], (vf)(r->sx), VLOAD(leaf + (3 * k + r->kx) * NODE_WIDTH) - ox);
        y[k] = fma(-z[k], (vf)(r->sy), VLOAD(leaf + (3 * k + r->ky) * NODE_WIDTH) - oy);
    }
    vd e[3];
    for (int k = 0; k < 3; ++k) {
        const int a = (k + 1) % 3, b = (k + 2) % 3;
        e[k] = TO_VD(x[a]) * TO_VD(y[b]) - TO_VD(y[a]) * TO_VD(x[b]);
    }
    const vd sum = e[0] + e[1] + e[2];
    const vd zero = 0;
    vi mask = VD_MASK(((e[0] >= zero) & (e[1] >= zero) & (e[2] >= zero)) | ((e[0] <= zero) & (e[1] <= zero) & (e[2] <= zero)));
    mask &= VD_MASK(sum != zero);
    if (!row_any(mask)) return;
    const vf t = VD_TO_VF((e[0] * TO_VD(z[0]) + e[1] * TO_VD(z[1]) + e[2] * TO_VD(z[2])) / sum) * r->sz;
    mask &= GT(t, (vf)(0.0f)) & LE(t, (vf)(hit->t));
    private float times[LANES], first[LANES], second[LANES];
    VSTORE(t, times);
    VSTORE(VD_TO_VF(e[0] / sum), first);
    VSTORE(VD_TO_VF(e[1] / sum), second);
    for (uint bits = row_bits(mask); bits; bits &= bits - 1) {
        const uint lane = lowest(bits);
        if (!(times[lane] < hit->t || (times[lane] == hit->t && ids[lane] < hit->id))) continue;
        hit->t = times[lane];
        hit->id = ids[lane];
        hit->weights = (float3)(first[lane], second[lane], 1.0f - first[lane] - second[lane]);
    }
}

// The children of a node nearest along the ray first: sorted insertion on the stack.
inline void push_children(const Bvh *bvh, const Ray *r, int node, uint bits, Walk *walk, Hit *hit)
{
    global const int *children = bvh->children + node * NODE_WIDTH;
    global const float *boxes = bvh->boxes + node * 6 * NODE_WIDTH;
    const int base = walk->size;
    for (; bits; bits &= bits - 1) {
        const uint lane = lowest(bits);
        if (children[lane] < 0) {
            const int leaf = -1 - children[lane];
            for (int part = 0; part < NODE_WIDTH; part += LANES)
                ray_leaf(r, bvh->leaves + leaf * 9 * NODE_WIDTH + part, bvh->leaf_ids + leaf * NODE_WIDTH + part, hit);
            continue;
        }
        float near = 0.0f;
        for (int k = 0; k < 3; ++k) {
            const float o = axis(r->origin, k), inverse = axis(r->inverse, k);
            near = max(near, min((boxes[k * NODE_WIDTH + lane] - o) * inverse, (boxes[(3 + k) * NODE_WIDTH + lane] - o) * inverse));
        }
        int at = walk->size++;
        for (; at > base && walk->z[at - 1] < near; --at) {
            walk->z[at] = walk->z[at - 1];
            walk->node[at] = walk->node[at - 1];
        }
        walk->z[at] = near;
        walk->node[at] = children[lane];
    }
}

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void closest_hits(global const float *restrict boxes,
                  global const int *restrict children,
                  global const float *restrict leaves,
                  global const int *restrict leaf_ids,
                  global const float *restrict origins,     // (R, 3)
                  global const float *restrict directions,  // (R, 3)
                  const int n_rays,
                  global int *restrict next,
                  global int *restrict triangle,            // (R,)
                  global float *restrict distance,          // (R,) parameter of the ray as given
                  global float *restrict weights)           // (R, 3)
{
    const Bvh bvh = {boxes, children, leaves, leaf_ids};
    Walk walk;
    for (int first = 64 * atomic_inc(next); first < n_rays; first = 64 * atomic_inc(next))
        for (int ray = first; ray < min(first + 64, n_rays); ++ray) {
            const float3 o = vload3(ray, origins), d = vload3(ray, directions);
            const float size = max(fabs(d.x), max(fabs(d.y), fabs(d.z)));
            Hit hit = {FAR, -1, (float3)(NAN)};
            int exponent = 0;
            if (all(isfinite(o)) && all(isfinite(d)) && size > 0.0f) {
                exponent = ilogb(size);
                const Ray r = make_ray(o, ldexp(d, (int3)(-exponent)));
                walk.node[0] = 0; walk.z[0] = 0.0f; walk.size = 1;
                while (walk.size) {
                    const int node = walk.node[--walk.size];
                    if (walk.z[walk.size] > hit.t * 1.0000004f) continue;
                    uint bits = 0;
                    for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
                        bits |= row_bits(ray_meets(&r, bvh.boxes + node * 6 * NODE_WIDTH + lane, hit.t)) << lane;
                    push_children(&bvh, &r, node, bits, &walk, &hit);
                }
            }
            triangle[ray] = hit.id;
            distance[ray] = hit.id < 0 ? INFINITY : ldexp(hit.t, -exponent);
            vstore3(hit.weights, ray, weights);
        }
}
