// Rays that are no bundle, one at a time.
#include "walk.cl"

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void closest_hits(BVH_PARAMETERS,
                  global const float *restrict origins,     // (R, 3)
                  global const float *restrict directions,  // (R, 3)
                  const int n_rays,
                  global int *restrict next,
                  global int *restrict triangle,            // (R,)
                  global float *restrict distance,          // (R,) parameter of the ray as given
                  global float *restrict weights)           // (R, 3)
{
    const Bvh bvh = MAKE_BVH;
    for (int first = 64 * atomic_inc(next); first < n_rays; first = 64 * atomic_inc(next))
        for (int ray = first; ray < min(first + 64, n_rays); ++ray) {
            const float3 o = vload3(ray, origins), d = vload3(ray, directions);
            const float size = max(fabs(d.x), max(fabs(d.y), fabs(d.z)));
            Hit hit = {FAR, -1, (float3)(NAN)};
            int exponent = 0;
            if (all(isfinite(o)) && all(isfinite(d)) && size > 0.0f) {
                const Ray r = scaled_ray(o, d, &exponent);
                closest_hit(&bvh, &r, &hit);
            }
            triangle[ray] = hit.id;
            distance[ray] = hit.id < 0 ? INFINITY : ldexp(hit.t, -exponent);
            vstore3(hit.weights, ray, weights);
        }
}
