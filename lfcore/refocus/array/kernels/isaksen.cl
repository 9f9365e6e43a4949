// Cone-filtered sum over the data cameras near the central ray; one work-item per pixel.

#include "lookup.cl"

kernel void isaksen(isaksen_PARAMETERS)
{
    const int u = get_global_id(0);
    const int v = get_global_id(1) + first_row;
    if (u >= view.width || v >= view.height) {
        return;
    }
    const float3 origin = view_position(&view);
    const float3 direction = view_direction(&view, u + 0.5f, v + 0.5f);
    const float q =
        surface_inverse_depth(&surface, map, &view, origin, direction, u + 0.5f, v + 0.5f);
    float s, t, share;
    crossing(&array, origin, direction, &s, &t);
    Sum sum = sum_zero();
    if (direction.z > 0.0f) {
        const int first = interval(columns, array.columns, s - filter_width, &share);
        int j = interval(rows, array.rows, t - filter_width, &share);
        for (; j < array.rows && rows[j] < t + filter_width; ++j) {
            for (int i = first; i < array.columns && columns[i] < s + filter_width; ++i) {
                const float distance = hypot(s - columns[i], t - rows[j]);
                const float weight = fmax(1.0f - distance / filter_width, 0.0f);
                add_lookup(
                    &sum, weight, image, &array, i, j, columns[i], rows[j],
                    origin, direction, q);
            }
        }
    }
    const float scale = sum.weight > 0.0f ? 1.0f / sum.weight : 0.0f;
    out[(size_t)v * view.width + u] = (float4)(
        sum.red * scale, sum.green * scale, sum.blue * scale, sum.weight > 0.0f ? 1.0f : 0.0f);
}
