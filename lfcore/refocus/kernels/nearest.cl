// The nearest surface in each pixel of a picture from a point of the lens, by the rays of views
// around it.

// One row of a view.  `found` (2, height, width) has, of the middle half of each pixel and of all
// of it, the bits of the inverse depth plus one, which are in the order of its values; 0 for none.
kernel void nearest(nearest_PARAMETERS)
{
    const int v = get_global_id(0), view = get_global_id(1), width = numbers.width;
    const SeenView s = views[view];
    global const float *row = depth + ((ulong)s.number * numbers.rows + v) * numbers.columns;
    for (int u = 0; u < numbers.columns; ++u) {
        const float inverse = 1.0f / row[u];
        const float x = fma((float)u, numbers.step, s.x) + s.move_x * inverse;
        const float y = fma((float)v, numbers.step, s.y) + s.move_y * inverse;
        if (!(x >= 0.0f && x < width && y >= 0.0f && y < numbers.height)) continue;
        const int column = (int)x, line = (int)y;
        const ulong at = (ulong)line * width + column;
        const float off = fmax(fabs(x - column - 0.5f), fabs(y - line - 0.5f));
        const uint code = as_uint(inverse) + 1;
        if (off <= 0.25f) atomic_max(found + at, code);
        atomic_max(found + (ulong)width * numbers.height + at, code);
    }
}
