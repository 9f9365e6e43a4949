// Rays that are no bundle, one at a time.
#include "walk.cl"

// `origins`, `directions`, `weights`: (R, 3); `triangle`, `distance`: (R,).  Distance is the
// parameter of the ray as given.
KERNEL void closest_hits(CLOSEST_HITS_PARAMETERS)
{
    const Tree tree = MAKE_TREE;
    for (int first = 64 * atomic_inc(next); first < ray_count; first = 64 * atomic_inc(next))
        for (int ray = first; ray < min(first + 64, ray_count); ++ray) {
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
