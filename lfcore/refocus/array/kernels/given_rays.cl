// Weighted average of given rays, `count` for each pixel; one work-item per pixel.

#include "lookup.cl"

kernel void given_rays(given_rays_PARAMETERS)
{
    const int pixel = get_global_id(0);
    if (pixel >= pixels) {
        return;
    }
    Sum total = sum_zero();
    for (int k = 0; k < count; ++k) {
        const GivenRay ray = rays[(size_t)pixel * count + k];
        const float3 origin = vload3(0, ray.origin), direction = vload3(0, ray.direction);
        const float q = surface_inverse_depth(
            &surface, map, &view, origin, direction, ray.film[0], ray.film[1]);
        const Sum value =
            quadrilinear(image, &array, columns, rows, origin, direction, q);
        total.red += ray.weight * value.red;
        total.green += ray.weight * value.green;
        total.blue += ray.weight * value.blue;
        total.weight += ray.weight == 0.0f ? 1.0f : value.weight;
    }
    const float scale = total.weight > 0.0f ? 1.0f / total.weight : 0.0f;
    out[pixel] = (float4)(
        total.red * scale, total.green * scale, total.blue * scale, total.weight / count);
}
