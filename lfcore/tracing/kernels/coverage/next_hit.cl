// The next hit of a path, which starts on the triangle that it met last.
//
// A mirrored ray ignores what is within a rounding error of its start.  A ray that passes starts an
// error early, so that it meets both of two coincident faces; but within the error it meets no
// triangle of the same material that faces the same side, a neighbour beside an edge.
#pragma once
#include "camera_rays.cl"
#include "surfaces.cl"

// The rounding error of a hit point, a share of its largest coordinate.
#define START_ERROR GAMMA(32.0f)

// The start of a path, and the time in units of the ray's within which triangles are ignored.
typedef struct { const Scene *scene; global const Path *path; float3 direction; float near; } Start;

inline float3 face_normal(const Scene *s, int id)
{
    const float3 p = corner(s, id, 0);
    return cross_product(corner(s, id, 1) - p, corner(s, id, 2) - p);
}

inline int is_ignored(const Start *start, int id, float time)
{
    const Scene *s = start->scene;
    const int last = start->path->last[0];
    if (id == last) return 1;
    if (last < 0 || time > start->near) return 0;
    if (!start->path->passes || id == start->path->last[1]) return 1;
    const float facing = inner_product(face_normal(s, id), start->direction) *
                         inner_product(face_normal(s, last), start->direction);
    return s->material_ids[id] == s->material_ids[last] && facing > 0.0f;
}

inline void take_next(const Tree *tree, const Ray *r, int leaf, uint bits, const Start *start,
                      Hit *hit)
{
    for (; bits; bits &= bits - 1) {
        const int at = lowest(bits);
        float time;
        float3 weights;
        if (!hits_triangle(r, tree->leaves + leaf, at, &time, &weights) || time > hit->t) continue;
        const int id = triangle_ids(tree, leaf, at)[0];
        if ((time == hit->t && id >= hit->id) || is_ignored(start, id, time)) continue;
        if (is_solid(&tree->alpha_tests, id, r->origin + time * r->direction))
            *hit = (Hit){time, id, weights};
    }
}

inline Hit next_hit(const Tree *tree, const Scene *scene, global const Path *path)
{
    const float3 direction = vload3(0, path->direction), from = vload3(0, path->origin);
    const float error = path->last[0] < 0 ? 0.0f : START_ERROR * largest_component(from);
    const float early = path->passes ? error : 0.0f;
    int exponent;
    const Ray r = scaled_ray(from - early * direction, direction, &exponent);
    const float scale = ldexp(1.0f, exponent);
    const Start start = {scene, path, direction, (early + error) * scale};
    const float3 inverse = r.path.inverse_lo;
    const Volume volume = {0, &r.path, 1 + (inverse.x * inverse.y * inverse.z != 0.0f)};
    Hit hit = {FAR, -1};
    Stack stack;
    start_walk(&stack);
    for (int leaf; (leaf = next_leaf(tree, &volume, hit.t * SWEEP_SLACK, &stack)) >= 0;) {
        const float far = hit.t * SWEEP_SLACK;
        take_next(tree, &r, leaf, may_hit(&r, tree->leaves + leaf, far), &start, &hit);
    }
    hit.t = times_power((float3)(hit.t), -exponent).x - early;
    return hit.id < 0 ? MISS : hit;
}
