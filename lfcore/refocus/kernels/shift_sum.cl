// Shift-sum refocusing: every output pixel gathers one sample of each view (equation 6.1).  A row
// of the picture reads rows of views, LANES pixels at a time, for one plane after another, so rows
// stay in the cache; sums are integers, independent of the order of views.
//
// MAGNIFIED: source pixels come from tables instead of one shift per view.  SUM is the type of the
// accumulators.
#include "lanes.cl"

// LANES pixels of a row from x on; zero outside the view.
inline vu load_pixels(global const uint *row, int x, int width)
{
    if (x >= width || x + LANES <= 0) return (vu)(0);
    if (x >= 0 && x + LANES <= width) return VLOAD(row + x);
    private uint some[LANES];
    for (int k = 0; k < LANES; ++k)
        some[k] = x + k >= 0 && x + k < width ? row[clamp(x + k, 0, width - 1)] : 0;
    return VLOAD(some);
}

inline vu gather_pixels(global const uint *row, const int *at, int step, int width)
{
    private uint some[LANES];
    for (int k = 0; k < LANES; ++k) {
        const int x = at[k] + step;
        some[k] = x >= 0 && x < width ? row[x] : 0;
    }
    return VLOAD(some);
}

inline vu mix_pixels(vu a, vu b, vu c, vu d, vf right, float down)
{
    const vf fa = TO_VF(a), fc = TO_VF(c);
    const vf upper = fma(right, TO_VF(b) - fa, fa), lower = fma(right, TO_VF(d) - fc, fc);
    return TO_VU(fma((vf)(down), lower - upper, upper) + 0.5f);
}

// Where LANES pixels of the picture lie in views of width x height pixels: in row `line` from
// column `at` on, or in columns `at` each; and how far to the right and below.
typedef struct {
#if MAGNIFIED
    int at[LANES];
#else
    int at;
#endif
    int line, width, height, is_bilinear;
    vf right;
    float down;
} Source;

// The pixels `step` columns and `below` rows beside the source; zero outside the view.
inline vu pixels_at(global const uint *view, const Source *s, int step, int below)
{
    const int line = s->line + below;
    if (line < 0 || line >= s->height) return (vu)(0);
    global const uint *row = view + line * s->width;
#if MAGNIFIED
    return gather_pixels(row, s->at, step, s->width);
#else
    return load_pixels(row, s->at + step, s->width);
#endif
}

inline vu sample(global const uint *view, const Source *s)
{
    const vu here = pixels_at(view, s, 0, 0);
    if (!s->is_bilinear) return here;
    return mix_pixels(here, pixels_at(view, s, 1, 0), pixels_at(view, s, 0, 1),
                      pixels_at(view, s, 1, 1), s->right, s->down);
}

inline void add_row(global SUM *sums, vu values, int count)
{
    private uint some[LANES];
    VSTORE(values, some);
    for (int k = 0; k < count; ++k) sums[k] += some[k];
}

// Add a group of views, few enough that their sums fit in 32 bits, or a rectangle of them, to one
// row of one plane.
KERNEL void add_views(add_views_PARAMETERS)
{
    const ShiftSumArguments n = numbers;
    const int y = get_global_id(2) + n.top, plane = get_global_id(1), size = n.size;
    const int width = n.width, height = n.height;
    const ulong area = (ulong)width * height, square = (ulong)size * size;
    global SUM *out = sums + plane * 3 * square + (ulong)y * size;
    const int stretch = (n.right - n.left + get_global_size(0) - 1) / get_global_size(0);
    const int begin = n.left + get_global_id(0) * stretch, end = min(begin + stretch, n.right);
    for (int x = begin; x < end; x += LANES) {
        vu red = (vu)(0), green = (vu)(0), blue = (vu)(0);
        for (int entry = lists[plane].first; entry < lists[plane].end; ++entry) {
            const ShiftedView e = entries[entry];
            Source from = {.width = width, .height = height, .is_bilinear = n.is_bilinear};
#if MAGNIFIED
            const int across = (plane * n.lens + e.x) * size;
            const int row = (plane * n.lens + e.y) * size + y;
            from.line = first[row] - n.row;
            private float next[LANES];
            for (int k = 0; k < LANES; ++k) {
                from.at[k] = first[across + min(x + k, size - 1)] - n.column;
                next[k] = share[across + min(x + k, size - 1)];
            }
            from.right = VLOAD(next);
            from.down = share[row];
#else
            from.at = x + e.x - n.column;
            from.line = y + e.y - n.row;
            from.right = (vf)(e.right);
            from.down = e.below;
            if (from.line >= height || from.line + 1 < 0) continue;
#endif
            global const uint *view = views + e.view * 3 * area;
            red += sample(view, &from);
            green += sample(view + area, &from);
            blue += sample(view + 2 * area, &from);
        }
        const int count = min(LANES, end - x);
        add_row(out + x, red, count);
        add_row(out + square + x, green, count);
        add_row(out + 2 * square + x, blue, count);
    }
}

// Sums of groups of views to their means, in place.
kernel void scale_views(scale_views_PARAMETERS)
{
    const ulong at = get_global_id(0);
    views[at] = (views[at] + divisor / 2) / divisor;
}
