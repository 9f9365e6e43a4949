// Camera rays traced one by one: blocks with incoherent rays, and single rays.
#pragma once
#include "depth_buffer.cl"

typedef struct { float t; int id; float3 weights; } Hit;

// Replace `hit` by the nearest of the triangles `bits` of a leaf if it is nearer; at equal distance
// the lowest number wins.
inline void take_nearest(const Tree *tree, const Ray *r, int leaf, uint bits, Hit *hit)
{
    for (; bits; bits &= bits - 1) {
        const int at = lowest(bits);
        float time;
        float3 weights;
        if (!hits_triangle(r, tree->leaves + leaf, at, &time, &weights) || time > hit->t) continue;
        const int id = triangle_ids(tree, leaf, at)[0];
        if (time == hit->t && id >= hit->id) continue;
        if (!is_solid(&tree->alpha_tests, id, r->origin + time * r->direction)) continue;
        *hit = (Hit){time, id, weights};
    }
}

#define MISS ((Hit){INFINITY, -1, (float3)(NAN)})

// The first triangle that a ray hits; `t` is the parameter of the given ray.
inline Hit closest_hit(const Tree *tree, float3 origin, float3 direction)
{
    int exponent;
    const Ray r = scaled_ray(origin, direction, &exponent);
    const float3 inverse = r.path.inverse_lo;
    const Volume volume = {0, &r.path, 1 + (inverse.x * inverse.y * inverse.z != 0.0f)};
    Hit hit = {FAR, -1};
    Stack stack;
    start_walk(&stack);
    float far;
    for (int leaf; far = hit.t * SWEEP_SLACK, (leaf = next_leaf(tree, &volume, far, &stack)) >= 0;)
        take_nearest(tree, &r, leaf, may_hit(&r, tree->leaves + leaf, far), &hit);
    hit.t = times_power((float3)(hit.t), -exponent).x;
    return hit.id < 0 ? MISS : hit;
}

// Trace the rays of a packet one by one: for incoherent rays, setting up triangles per block costs
// more.
inline void follow_packet(const Tree *tree, const Packet *p, Coverage *blocks)
{
    for (int block = 0; block < p->rays->blocks; ++block) {
        if (!has_block(p, block)) continue;
        const Bundle r = block_bundle(p, block);
        const int2 inside = block_inside(p, block);
        Coverage *c = blocks + block;
        for (int at = 0; at < BLOCK_RAYS; ++at) {
            const int i = at % BLOCK, j = at / BLOCK;
            const float x = i - r.half_extent, y = j - r.half_extent;
            const float3 origin = (float3)(fma(x, r.sx, r.ox), fma(y, r.sy, r.oy), 0.0f);
            const float3 along = (float3)(fma(x, r.tx, r.dx), fma(y, r.ty, r.dy), 1.0f);
            const Hit hit = i < inside.x && j < inside.y ? closest_hit(tree, origin, along) : MISS;
            c->z[at] = hit.t;
            c->ids[at] = hit.id;
        }
    }
}
