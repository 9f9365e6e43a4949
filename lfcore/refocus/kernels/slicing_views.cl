// Algorithms 1 and 4: sensor planes from views, traced or decoded.  TRACED is 1 for traced light,
// 0 for frames.
#if TRACED
#include "fixed_point.cl"
#include "blocks.cl"
typedef float stored;

// Columns and rows of linear light (height, width, 3) from `at` on as a block (3, BLOCK_RAYS).
inline void load_block(const SensorPlaneArguments *n, global const float *light, int2 at,
                       int columns, int rows, global float *colours)
{
    const int width = n->rays_width;
    global const float *from = light + 3 * ((ulong)at.y * width + at.x);
    for (int y = 0; y < min(rows, BLOCK); ++y, from += 3 * width, colours += BLOCK)
        for (int k = 0; k < 3 * min(columns, BLOCK); ++k)
            colours[k % 3 * BLOCK_RAYS + k / 3] = clamp(from[k], 0.0f, n->brightest);
}

inline global const float *element_at(const SensorPlaneArguments *n, global const float *light,
                                      int element, Placement placed)
{
    return light + (ulong)element * 3 * n->rays_width * n->rays_height;
}
inline int2 corner_of(Placement placed) { return 0; }
#else
#include "light.cl"
#include "blocks.cl"
typedef sample stored;

// The samples of LANES pixels of a line from `first` on, each of two pixels if `halved`; those beyond
// `count` repeat the last.
inline vf load_row(global const sample *line, int first, int halved, int count)
{
    private float row[LANES];
    for (int k = 0; k < LANES; ++k) row[k] = (float)line[(first + min(k, count - 1)) >> halved] * SCALE;
    return VLOAD(row);
}

// Decode a block to linear colours (3, BLOCK_RAYS); rays beyond columns and rows repeat the last.
inline void load_block(const SensorPlaneArguments *n, global const sample *frame, int2 at,
                       int columns, int rows, global float *colours)
{
    const int width = n->rays_width, halved = n->halved, x0 = at.x, y0 = at.y;
    const ulong pixels = (ulong)width * n->rays_height, chroma = pixels >> 2 * halved;
    for (int ray = 0; ray < BLOCK_RAYS; ray += LANES) {
        const int x = min(ray % BLOCK, columns - 1), y = min(ray / BLOCK, rows - 1);
        const int count = max(1, columns - x);
        const vf first = load_row(frame + (ulong)(y0 + y) * width, x0 + x, 0, count);
        const ulong line = (y0 + y) >> halved;
        global const sample *small = frame + pixels + line * (width >> halved);
        const vf second = load_row(small, x0 + x, halved, count);
        const vf third = load_row(small + chroma, x0 + x, halved, count);
        TO_RGB(vf, n->is_rgb, first, second, third, r, g, b);
        // Multiples of the fixed-point unit; division by a power of two is exact.
        VSTORE(TO_VF(linear_row(r)) / LIGHT_ONE, colours + ray);
        VSTORE(TO_VF(linear_row(g)) / LIGHT_ONE, colours + BLOCK_RAYS + ray);
        VSTORE(TO_VF(linear_row(b)) / LIGHT_ONE, colours + 2 * BLOCK_RAYS + ray);
    }
}

inline global const sample *element_at(const SensorPlaneArguments *n, global const sample *frames,
                                       int element, Placement placed)
{
    const ulong pixels = (ulong)n->rays_width * n->rays_height;
    return frames + placed.frame * (pixels + 2 * (pixels >> 2 * n->halved));
}
inline int2 corner_of(Placement placed) { return (int2)(placed.x, placed.y); }
#endif

typedef struct {
    const SensorPlaneArguments *numbers;
    global const SensorPlane *planes;
    global const int *targets;
    global const uchar *masks;
    global ulong4 *sums;  // (planes, height, width) of this worker: red, green, blue, 0
} SensorPlanes;

// Add a block of pixels of the view of lens sample `view`, whose first pixel is `at`.
inline void add_view(const SensorPlanes *p, int2 view, int2 at, global const float *colours)
{
    const SensorPlaneArguments *n = p->numbers;
    const int columns = min(BLOCK, n->columns - at.x), rows = min(BLOCK, n->rows - at.y);
    // Added before fractions are dropped, as in fixed_point.cl.
    const float part = n->coarse ? (((view.x + 4 * view.y) & 15) + 0.5f) / 16.0f : 0.5f;
    const float one = n->one;
    for (int plane = 0; plane < n->planes; ++plane) {
        const SensorPlane info = p->planes[plane];
        if (!p->masks[((ulong)info.mask * n->views + view.y) * n->views + view.x]) continue;
        global const int *targets = p->targets + info.targets;
        global const int *columns_to = targets + view.x * n->size + n->column + at.x;
        global const int *rows_to = targets + view.y * n->size + n->row + at.y;
        global ulong4 *sums = p->sums + (ulong)plane * n->width * n->height;
        for (int y = 0; y < rows; ++y) {
            const int line_y = rows_to[y] - n->top;
            if (line_y < 0 || line_y >= n->height) continue;
            global const float *c = colours + y * BLOCK;
            for (int x = 0; x < columns; ++x) {
                const int line_x = columns_to[x] - n->left;
                if (line_x < 0 || line_x >= n->width) continue;
                const float4 colour = {c[x], c[BLOCK_RAYS + x], c[2 * BLOCK_RAYS + x], 0.0f};
                const float4 rounded = (float4)((float3)(part), 0.0f);
                const int4 fixed = convert_int4(fma(colour, (float4)(one), rounded));
                sums[(ulong)line_y * n->width + line_x] += convert_ulong4(as_uint4(fixed));
            }
        }
    }
}

KERNEL void form_view_planes(form_view_planes_PARAMETERS)
{
    const ulong own = get_global_id(0) * (ulong)numbers.planes * numbers.width * numbers.height;
    const SensorPlanes to = {&numbers, planes, targets, masks, sums + own};
    const ulong words = get_global_id(0) * (ulong)numbers.scratch_words;
    global float *colours = (global float *)(scratch + words);
    const int columns = numbers.columns, rows = numbers.rows, elements = numbers.elements;
    for (int element = atomic_inc(next); element < elements; element = atomic_inc(next)) {
        const Placement placed = placements[element];
        const int2 sample = (int2)(placed.column, placed.row), corner = corner_of(placed);
        global const stored *view = element_at(&numbers, rays, element, placed);
        for (int y = 0; y < rows; y += BLOCK)
            for (int x = 0; x < columns; x += BLOCK) {
                load_block(&numbers, view, corner + (int2)(x, y), columns - x, rows - y, colours);
                add_view(&to, sample, (int2)(x, y), colours);
            }
    }
}
