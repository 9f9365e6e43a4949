// Shadow rays traced one by one: of given rays, and of blocks with so many triangles that rays share
// little.
#pragma once
#include "camera_rays.cl"
#include "occluders.cl"

// The LANES triangles from `lane` on of a leaf that may shade a ray: those that light passes if
// `clear`, else the others.  The receiver, the light's own and triangles within the margin of the
// receiver do not count.
inline uint shading_lanes(const Shadows *s, const Ray *r, int leaf, int lane, int receiver,
                          int2 light, int clear)
{
    global const int *ids = triangle_ids(s->tree, leaf, lane);
    const vi passed = are_clear(s->scene, ids);
    const vi left_out = EQ(VLOAD(ids), (vi)(receiver)) | are_of_light(light, ids) |
                        (clear ? ~passed : passed);
    Vec v[3];
    load_corners(s->tree->leaves + leaf, lane, 0.0f, v);
    const Vec n = geometric_normals(v);
    const vf off = dot3(n, minus3(v[0], spread3(r->origin)));
    const vi is_off = GT(fabs(off), shadow_margin(n, v[0], fabs(r->origin)));
    return row_bits(is_off & ~left_out) << lane;
}

// Whether a triangle of a leaf occludes the ray nearer than `far`.
inline int occludes(const Shadows *s, const Ray *r, int leaf, float far, int receiver, int2 light)
{
    Hit hit = {far, -1};
    const uint bits = may_hit(r, s->tree->leaves + leaf, far * SWEEP_SLACK);
    for (int lane = 0; bits >> lane && lane < NODE_WIDTH && hit.id < 0; lane += LANES)
        take_nearest(s->tree, r, leaf, bits & shading_lanes(s, r, leaf, lane, receiver, light, 0),
                     0, &hit);
    return hit.id >= 0;
}

// The leaf that occludes the ray nearer than `far`, or -1.
inline int occluding_leaf(const Shadows *s, const Ray *r, float far, int receiver, int2 light)
{
    const Volume volume = {.sweep = &r->path, .sorted = 1};
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
