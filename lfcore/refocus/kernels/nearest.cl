// The nearest surface in each pixel of a picture from a point of the lens, by the rays of views around it.

typedef struct {
    float x, y;            // position of pixel (0, 0)'s ray at depth infinity, in pixels of the picture
    float move_x, move_y;  // pixels per dioptre
} Seen;

// found: (2, height, width), of the middle half of each pixel and of all of it; the bits of the inverse depth plus
// one, which are in the order of its values, 0 for none.
kernel void nearest(global const float *restrict depth,  // (views, rows, columns), metres
                    global const Seen *restrict seen,
                    global const int *restrict numbers,  // of the views in `depth`
                    const int columns,
                    const int rows,
                    const float step,                    // pixels of the picture from ray to ray
                    const int width,
                    const int height,
                    global uint *restrict found)
{
    const int v = get_global_id(0), view = get_global_id(1);
    const Seen s = seen[view];
    global const float *row = depth + ((ulong)numbers[view] * rows + v) * columns;
    for (int u = 0; u < columns; ++u) {
        const float inverse = 1.0f / row[u];
        const float x = fma((float)u, step, s.x) + s.move_x * inverse;
        const float y = fma((float)v, step, s.y) + s.move_y * inverse;
        if (!(x >= 0.0f && x < width && y >= 0.0f && y < height)) continue;
        const int column = (int)x, line = (int)y;
        const ulong at = (ulong)line * width + column;
        const float off = fmax(fabs(x - column - 0.5f), fabs(y - line - 0.5f));
        const uint code = as_uint(inverse) + 1;
        if (off <= 0.25f) atomic_max(found + at, code);
        atomic_max(found + (ulong)width * height + at, code);
    }
}
