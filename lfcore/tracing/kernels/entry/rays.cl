// Rays that are no bundle, one at a time.
#include "walk.cl"

KERNEL void closest_hits(TREE_PARAMETERS,
                         global const float *restrict origins,     // (R, 3)
                         global const float *restrict directions,  // (R, 3)
                         const int n_rays,
                         global int *restrict next,
                         global int *restrict triangle,            // (R,)
                         // (R,) parameter of the ray as given.
                         global float *restrict distance,
                         global float *restrict weights)           // (R, 3)
{
    const Tree tree = MAKE_TREE;
    for (int first = 64 * atomic_inc(next); first < n_rays; first = 64 * atomic_inc(next))
        for (int ray = first; ray < min(first + 64, n_rays); ++ray) {
            const float3 o = vload3(ray, origins), d = vload3(ray, directions);
            Hit hit = {FAR, -1, (float3)(NAN)};
            int exponent = 0;
            if (all(isfinite(o)) && all(isfinite(d)) && any(d != 0.0f)) {
                const Ray r = scaled_ray(o, d, &exponent);
                closest_hit(&tree, &r, &hit);
            }
            triangle[ray] = hit.id;
            distance[ray] = hit.id < 0 ? INFINITY : ldexp(hit.t, -exponent);
            vstore3(hit.weights, ray, weights);
        }
}
