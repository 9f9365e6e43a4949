// Weighted average of given rays, `count` for each pixel; one work-item per pixel.
//
// rays: 8 floats each: origin, direction, weight, unused.  film: 2 floats, pixels.

#include "lookup.cl"

kernel void given_rays(
    FIELD_PARAMETERS,
    global const float8 *restrict rays,
    global const float2 *restrict film,
    const int count,
    const int pixels,
    global float4 *restrict out)
{
    const int pixel = get_global_id(0);
    if (pixel >= pixels) {
        return;
    }
    Sum total = sum_zero();
    for (int k = 0; k < count; ++k) {
        const size_t index = (size_t)pixel * count + k;
        const float8 ray = rays[index];
        // Weight 0: stopped inside the lens, black, but a sample.
        const bool stopped = ray.s6 == 0.0f;
        const float3 origin = ray.s012, direction = ray.s345;
        const float2 place = film[index];
        const float q = surface_inverse_depth(
            &surface, map, &view, origin, direction, place.x, place.y);
        const Sum value =
            quadrilinear(image, &array, columns, rows, origin, direction, q);
        total.red += ray.s6 * value.red;
        total.green += ray.s6 * value.green;
        total.blue += ray.s6 * value.blue;
        total.weight += stopped ? 1.0f : value.weight;
    }
    const float scale = total.weight > 0.0f ? 1.0f / total.weight : 0.0f;
    out[pixel] = (float4)(
        total.red * scale, total.green * scale, total.blue * scale, total.weight / count);
}
