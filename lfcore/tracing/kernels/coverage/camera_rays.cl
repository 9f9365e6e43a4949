// Rays traced one by one: blocks with incoherent rays, given rays, and rays from surfaces.
#pragma once
#include "depth_buffer.cl"
#include "surfaces.cl"

typedef struct { float t; int id; float3 weights; } Hit;

#define MISS ((Hit){INFINITY, -1, (float3)(NAN)})

// The rounding error of a hit point, a share of its largest coordinate.
#define START_ERROR GAMMA(32.0f)

// Where a ray starts that a surface has sent on: from the `last` triangle that it met.  A mirrored
// ray ignores what is nearer than `near`, a rounding error.  A ray that passes starts an error early,
// so that it meets both of two coincident faces; but within the error it meets no triangle of the
// same material that faces the same side, a neighbour beside an edge.
typedef struct {
    const Scene *scene;
    float3 direction;
    int passes, last, before;  // `before`: the triangle before the last
    float near;
} Start;

inline int is_ignored(const Start *start, int id, float time)
{
    const Scene *s = start->scene;
    if (id == start->last) return 1;
    if (start->last < 0 || time > start->near) return 0;
    if (!start->passes || id == start->before) return 1;
    const float facing = inner_product(geometric_normal(s, id), start->direction) *
                         inner_product(geometric_normal(s, start->last), start->direction);
    return s->material_ids[id] == s->material_ids[start->last] && facing > 0.0f;
}

// Replace `hit` by the nearest of the triangles `bits` of a leaf if it is nearer; at equal distance
// the lowest number wins.  `start` may be 0.
inline void take_nearest(const Tree *tree, const Ray *r, int leaf, uint bits, const Start *start,
                         Hit *hit)
{
    for (; bits; bits &= bits - 1) {
        const int at = lowest(bits);
        float time;
        float3 weights;
        if (!hits_triangle(r, tree->leaves + leaf, at, &time, &weights) || time > hit->t) continue;
        const int id = triangle_ids(tree, leaf, at)[0];
        if (time == hit->t && id >= hit->id) continue;
        if (start && is_ignored(start, id, time)) continue;
        if (!is_solid(&tree->alpha_tests, id, r->origin + time * r->direction)) continue;
        *hit = (Hit){time, id, weights};
    }
}

// The first triangle that a ray hits.
inline Hit nearest_hit(const Tree *tree, const Ray *r, const Start *start)
{
    const float3 inverse = r->path.inverse_lo;
    const Volume volume = {.sweep = &r->path, .sorted = 1,
                           .oblique = inverse.x * inverse.y * inverse.z != 0.0f};
    Hit hit = {FAR, -1};
    Stack stack;
    start_walk(&stack);
    float far;
    for (int leaf; far = hit.t * SWEEP_SLACK, (leaf = next_leaf(tree, &volume, far, &stack)) >= 0;)
        take_nearest(tree, r, leaf, may_hit(r, tree->leaves + leaf, far), start, &hit);
    return hit;
}

// The first hit of a ray; `t` is the parameter of the given ray.
inline Hit closest_hit(const Tree *tree, float3 origin, float3 direction)
{
    int exponent;
    const Ray r = scaled_ray(origin, direction, &exponent);
    Hit hit = nearest_hit(tree, &r, 0);
    hit.t = times_power((float3)(hit.t), -exponent).x;
    return hit.id < 0 ? MISS : hit;
}

// The first hit of a ray that starts from a triangle.
inline Hit next_hit(const Tree *tree, float3 origin, Start *start)
{
    const float error = start->last < 0 ? 0.0f : START_ERROR * largest_component(origin);
    const float early = start->passes ? error : 0.0f;
    int exponent;
    const Ray r = scaled_ray(origin - early * start->direction, start->direction, &exponent);
    start->near = (early + error) * ldexp(1.0f, exponent);
    Hit hit = nearest_hit(tree, &r, start);
    hit.t = times_power((float3)(hit.t), -exponent).x - early;
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
