// Shadow rays of a block followed one by one, where so many triangles are seen that they share
// little.
#pragma once
#include "occluders.cl"

// Whether a leaf holds a triangle, other than `own` and the light's, between the ray's origin and
// `far`. What lies within the margin of the ray's own surface is not in between.
inline int leaf_blocks(const Tree *tree, const Ray *r, int leaf, float far, int own, int2 light)
{
    Hit hit = {far, -1};
    for (int lane = 0; lane < NODE_WIDTH && hit.id < 0; lane += LANES) {
        global const Leaf *at = leaf_corners(tree, leaf, lane);
        global const int *ids = leaf_numbers(tree, leaf, lane);
        Sheared s;
        shear_leaf(r, at, &s);
        if (!row_any(s.mask)) continue;
        s.mask &= ~(EQ(VLOAD(ids), (vi)(own)) | are_of_light(light, ids));
        Vec v[3];
        load_corners(at, 0.0f, v);
        const Vec n = face_normal(v);
        const vf off = dot3(n, minus3(v[0], spread3(r->origin)));
        s.mask &= GT(fabs(off), shadow_margin(n, v[0], fabs(r->origin)));
        take_nearest(&tree->cut_outs, r, &s, ids, &hit);
    }
    return hit.id >= 0;
}

// The leaf that blocks the ray nearer than `far`, or -1.
inline int blocking_leaf(const Tree *tree, const Ray *r, float far, int own, int2 light)
{
    const Volume volume = {0, &r->path, 1};
    Stack stack;
    start_walk(&stack);
    int leaf;
    do leaf = next_leaf(tree, &volume, far, &stack);
    while (leaf >= 0 && !leaf_blocks(tree, r, leaf, far, own, light));
    return leaf;
}

// Take from s->active the rays of a block that cannot see a light.
inline void cast_single_rays(const Shadows *s, const Block *b, global const LightRecord *light)
{
    global const float *point = s->origins;
    const int2 own = vload2(0, light->triangles);
    int last = -1;  // what darkened a neighbour is likely to darken the next
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        if (!s->active[at]) continue;
        const float3 p = (float3)(point[at], point[BLOCK_RAYS + at], point[2 * BLOCK_RAYS + at]);
        const int triangle = b->samples->triangle[at];
        int exponent;
        const Ray ray = scaled_ray(p, vload3(0, light->vector) - (light->is_point ? p : 0.0f),
                                   &exponent);
        const float far = light->is_point ? ldexp(1.0f, exponent) : FAR;
        if (last < 0 || !leaf_blocks(s->tree, &ray, last, far, triangle, own))
            last = blocking_leaf(s->tree, &ray, far, triangle, own);
        if (last >= 0) s->active[at] = 0;
    }
}
