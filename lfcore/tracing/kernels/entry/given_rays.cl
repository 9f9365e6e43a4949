// Rays that are no bundle: the inner grid of one element, whose columns are their numbers.
#pragma once
#include "hit_buffers.cl"

// `origins`, `directions`, `weights`: (R, 3).  Depth is the parameter of the ray as given.
inline void hit_given_rays(const Tree *tree, const Packet *p, global const float *origins,
                           global const float *directions, const HitBuffers *to,
                           global float *weights)
{
    const int end = min(p->at.x + p->rays->packet_side, p->rays->columns);
    for (int ray = p->at.x; ray < end; ++ray) {
        const float3 o = vload3(ray, origins), d = vload3(ray, directions);
        Hit hit = {FAR, -1, (float3)(NAN)};
        int exponent = 0;
        if (all(isfinite(o)) && all(isfinite(d)) && any(d != 0.0f)) {
            const Ray r = scaled_ray(o, d, &exponent);
            closest_hit(tree, &r, &hit);
        }
        to->triangle[ray] = hit.id;
        to->depth[ray] = hit.id < 0 ? INFINITY : ldexp(hit.t, -exponent);
        vstore3(hit.weights, ray, weights);
    }
}
