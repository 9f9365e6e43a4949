// Shift-sum refocusing: views are unpacked to fixed-point light, then every output pixel gathers one
// sample of each view (equation 6.1).  A row of the picture reads rows of views, LANES pixels at a
// time, for one plane after another, so rows stay in the cache; sums are integers,
// independent of the order of views.
//
// MAGNIFIED: source pixels come from tables instead of one shift per view.  BILINEAR: four taps, not one.
// Of unpack_views: BITS, CHROMA, RGB, PQ, VIEWS as in slicing.cl.
#include "lanes.cl"

#ifdef BITS
#include "light.cl"

// One ray of frames to red, green, blue of a planar view.
inline void unpack(global const sample *frame, int width, int height, int x, int y, global uint *out, ulong plane)
{
    const ulong pixels = (ulong)width * height, chroma = pixels / (CHROMA * CHROMA);
    global const sample *small = frame + pixels + (ulong)(y / CHROMA) * (width / CHROMA) + x / CHROMA;
    const float first = frame[(ulong)y * width + x] * SCALE, second = small[0] * SCALE, third = small[chroma] * SCALE;
    TO_RGB(float, first, second, third, r, g, b);
    private uint light[3];
    linear_ray(r, g, b, light);
    for (int channel = 0; channel < 3; ++channel) out[channel * plane] = light[channel];
}

// views (K, 3, height, width) of the pixels of one tile, from frames that hold all their rays.
kernel void unpack_views(global const sample *restrict frames,
                         const int frame_width,
                         const int frame_height,
                         global const int4 *restrict places,   // per element: frame, x0, y0, 0
                         global const int2 *restrict samples,  // (K,) lens sample (i, j) [macropixels]
                         const int width,
                         const int height,
                         const int count,                      // K
                         global uint *restrict views)
{
    const ulong chroma = (ulong)(frame_width / CHROMA) * (frame_height / CHROMA);
    const ulong frame_samples = (ulong)frame_width * frame_height + 2 * chroma;
    const ulong plane = (ulong)width * height;
#if VIEWS
    const int x = get_global_id(0), y = get_global_id(1), k = get_global_id(2);
    const int4 place = places[k];
    const int2 at = (int2)(place.y + x, place.z + y);
#else
    // Lens samples innermost: they are neighbours in a frame.
    const int k = get_global_id(0), x = get_global_id(1), y = get_global_id(2);
    const int4 place = places[y * width + x];
    const int2 at = (int2)(place.y, place.z) + samples[k];
#endif
    global uint *out = views + k * 3 * plane + (ulong)y * width + x;
    unpack(frames + place.x * frame_samples, frame_width, frame_height, at.x, at.y, out, plane);
}
#endif

#ifdef BILINEAR
#ifndef SUM
#define SUM ulong  // of the accumulators
#endif

// LANES pixels of a row from x on; zero outside the view.
inline vu load_pixels(global const uint *row, int x, int width, int good)
{
    if (!good || x >= width || x + LANES <= 0) return (vu)(0);
    if (x >= 0 && x + LANES <= width) return VLOAD(row + x);
    private uint some[LANES];
    for (int k = 0; k < LANES; ++k) some[k] = x + k >= 0 && x + k < width ? row[clamp(x + k, 0, width - 1)] : 0;
    return VLOAD(some);
}

inline vu gather_pixels(global const uint *row, const int *at, int step, int width, int good)
{
    private uint some[LANES];
    for (int k = 0; k < LANES; ++k) {
        const int x = at[k] + step;
        some[k] = good && x >= 0 && x < width ? row[x] : 0;
    }
    return VLOAD(some);
}

#if MAGNIFIED
#define PIXELS(line, step) gather_pixels(view + max(line, 0) * width, at, step, width, line >= 0 && line < height)
#else
#define PIXELS(line, step) load_pixels(view + max(line, 0) * width, source + step, width, line >= 0 && line < height)
#endif
#if BILINEAR
#define SAMPLE(view) mix_pixels(PIXELS(line, 0), PIXELS(line, 1), PIXELS(below, 0), PIXELS(below, 1), right, down)
#else
#define SAMPLE(view) PIXELS(line, 0)
#endif

inline vu mix_pixels(vu a, vu b, vu c, vu d, vf right, float down)
{
    const vf fa = TO_VF(a), fc = TO_VF(c);
    const vf upper = fma(right, TO_VF(b) - fa, fa), lower = fma(right, TO_VF(d) - fc, fc);
    return TO_VU(fma((vf)(down), lower - upper, upper) + 0.5f);
}

inline void add_row(global SUM *sums, vu values, int count)
{
    private uint some[LANES];
    VSTORE(values, some);
    for (int k = 0; k < count; ++k) sums[k] += some[k];
}

// Add a group of at most 4095 views, 63 of PQ, (or a rectangle of them) to one row of one plane.
KERNEL
void add_views(global const uint *restrict views,    // (K, 3, height, width)
               const int4 region,                    // first column and row, width, height
               const int4 output,                    // rectangle of the planes: left, top, right, bottom
               const int size,                       // side M of a plane
               global const int2 *restrict lists,    // per plane: its entries, first and last + 1
               global const int4 *restrict entries,  // view k, and dx, dy or lens sample i, j; 0
               global const float2 *restrict shares, // per entry: of the right and lower tap
               global const int *restrict first,     // (planes, N, M) source pixel [MAGNIFIED]
               global const float *restrict share,   // (planes, N, M) of the next pixel
               const int lens,                       // N
               global SUM *restrict sums)            // (planes, 3, M, M)
{
    const int y = get_global_id(2) + output.y, plane = get_global_id(1);
    const int width = region.z, height = region.w;
    const ulong area = (ulong)width * height, square = (ulong)size * size;
    global SUM *out = sums + plane * 3 * square + (ulong)y * size;
    const int stretch = (output.z - output.x + get_global_size(0) - 1) / get_global_size(0);
    const int begin = output.x + get_global_id(0) * stretch, end = min(begin + stretch, output.z);
    for (int x = begin; x < end; x += LANES) {
        vu red = (vu)(0), green = (vu)(0), blue = (vu)(0);
        for (int entry = lists[plane].x; entry < lists[plane].y; ++entry) {
            const int4 e = entries[entry];
#if MAGNIFIED
            const int across = (plane * lens + e.y) * size, row = (plane * lens + e.z) * size + y;
            const int line = first[row] - region.y, below = line + 1;
            private int at[LANES];
            private float next[LANES];
            for (int k = 0; k < LANES; ++k) {
                at[k] = first[across + min(x + k, size - 1)] - region.x;
                next[k] = share[across + min(x + k, size - 1)];
            }
            const vf right = VLOAD(next);
            const float down = share[row];
#else
            const int source = x + e.y - region.x, line = y + e.z - region.y, below = line + 1;
            const vf right = (vf)(shares[entry].x);
            const float down = shares[entry].y;
            if (line >= height || below < 0) continue;
#endif
            global const uint *view = views + e.x * 3 * area;
            red += SAMPLE(view);
            view += area;
            green += SAMPLE(view);
            view += area;
            blue += SAMPLE(view);
        }
        const int count = min(LANES, end - x);
        add_row(out + x, red, count);
        add_row(out + square + x, green, count);
        add_row(out + 2 * square + x, blue, count);
    }
}

// Sums of groups of views to their means, in place.
kernel void scale_views(global uint *restrict views, const uint divisor)
{
    const ulong at = get_global_id(0);
    views[at] = (views[at] + divisor / 2) / divisor;
}
#endif
