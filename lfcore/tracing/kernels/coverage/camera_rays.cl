// Camera rays followed one by one: those of blocks whose rays have little in common, and rays that
// are no bundle.
#pragma once
#include "depth_buffer.cl"

typedef struct { float t; int id; float3 weights; } Hit;

// Take the nearest of LANES sheared triangles into `hit` if it is nearer; of equal ones the lowest
// number.
inline void take_nearest(const CutOuts *cut_outs, const Ray *r, const Sheared *s,
                         global const int *ids, Hit *hit)
{
    uint bits = row_any(s->mask) ? row_bits(s->mask & LE(s->time, (vf)(hit->t))) : 0;
    if (!bits) return;
    private float times[LANES], first[LANES], second[LANES];
    VSTORE(s->time, times);
    VSTORE(TO_VF(s->e[0] / s->sum), first);
    VSTORE(TO_VF(s->e[1] / s->sum), second);
    for (; bits; bits &= bits - 1) {
        const uint k = lowest(bits);
        if (!(times[k] < hit->t || (times[k] == hit->t && ids[k] < hit->id))) continue;
        if (!is_solid(cut_outs, ids[k], r->origin + times[k] * r->direction)) continue;
        hit->t = times[k];
        hit->id = ids[k];
        hit->weights = (float3)(first[k], second[k], 1.0f - first[k] - second[k]);
    }
}

#define MISS ((Hit){INFINITY, -1, (float3)(NAN)})

// The first triangle that a ray hits; `t` is the parameter of the ray as given.
inline Hit closest_hit(const Tree *tree, float3 origin, float3 direction)
{
    int exponent;
    const Ray r = scaled_ray(origin, direction, &exponent);
    const Volume volume = {0, &r.path, 1};
    Hit hit = {FAR, -1};
    Stack stack;
    start_walk(&stack);
    for (int leaf; (leaf = next_leaf(tree, &volume, hit.t * SWEEP_SLACK, &stack)) >= 0;)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
            Sheared s;
            shear_leaf(&r, leaf_corners(tree, leaf, lane), &s);
            take_nearest(&tree->cut_outs, &r, &s, triangle_ids(tree, leaf, lane), &hit);
        }
    hit.t = ldexp(hit.t, -exponent);
    return hit.id < 0 ? MISS : hit;
}

// Follow the rays of a packet one by one: where the rays of a block have little in common, setting
// up triangles for the block costs more.
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
        c->covering_triangle = BUFFERED;
    }
}
