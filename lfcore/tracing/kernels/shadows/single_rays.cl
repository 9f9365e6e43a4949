// Shadow rays traced one by one: of given rays, and of blocks with so many triangles that rays share
// little.
#pragma once
#include "camera_rays.cl"
#include "occluders.cl"

// Whether a triangle of a leaf, neither the receiver nor the light's, occludes the ray nearer than
// `far`.  Triangles within the margin of the receiver do not count.
inline int occludes(const Shadows *s, const Ray *r, int leaf, float far, int receiver, int2 light)
{
    const Tree *tree = s->tree;
    Hit hit = {far, -1};
    const uint bits = may_hit(r, tree->leaves + leaf, far * SWEEP_SLACK);
    for (int lane = 0; bits >> lane && lane < NODE_WIDTH && hit.id < 0; lane += LANES) {
        global const int *ids = triangle_ids(tree, leaf, lane);
        const vi own = EQ(VLOAD(ids), (vi)(receiver)) | are_of_light(light, ids) |
                       are_clear(s->scene, ids);
        Vec v[3];
        load_corners(tree->leaves + leaf, lane, 0.0f, v);
        const Vec n = geometric_normal(v);
        const vf off = dot3(n, minus3(v[0], spread3(r->origin)));
        const vi is_off = GT(fabs(off), shadow_margin(n, v[0], fabs(r->origin)));
        take_nearest(tree, r, leaf, bits & row_bits(is_off & ~own) << lane, &hit);
    }
    return hit.id >= 0;
}

// The leaf that occludes the ray nearer than `far`, or -1.
inline int occluding_leaf(const Shadows *s, const Ray *r, float far, int receiver, int2 light)
{
    const Volume volume = {0, &r->path, 1};
    Stack stack;
    start_walk(&stack);
    int leaf;
    do leaf = next_leaf(s->tree, &volume, far, &stack);
    while (leaf >= 0 && !occludes(s, r, leaf, far, receiver, light));
    return leaf;
}

// Remove from s->active the rays that are occluded from a light.
inline void cast_single_rays(const Shadows *s, global const Hits *hits,
                             global const LightRecord *light)
{
    global const float *point = s->origins;
    const int2 triangles = vload2(0, light->triangles);
    int last = -1;  // a leaf that occludes a ray is likely to occlude the next
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        if (!s->active[at]) continue;
        const float3 p = (float3)(point[at], point[BLOCK_RAYS + at], point[2 * BLOCK_RAYS + at]);
        const int receiver = hits->triangle[at];
        int exponent;
        const Ray ray = scaled_ray(p, vload3(0, light->vector) - (light->is_point ? p : 0.0f),
                                   &exponent);
        const float far = light->is_point ? ldexp(1.0f, exponent) : FAR;
        if (last < 0 || !occludes(s, &ray, last, far, receiver, triangles))
            last = occluding_leaf(s, &ray, far, receiver, triangles);
        if (last >= 0) s->active[at] = 0;
    }
}
