// Slicing by depth: a ray is spread over the box that its cell sweeps on a plane.
//
// Edges of boxes are whole numbers of 1 / STEPS pixel and light is in fixed point, so the sums are the same
// in whatever order, by however many threads and in however many parts rays are added.  Each work-item owns
// a strip of rows of one plane; no two ever write to the same place.
//
// Boxes of the inner layers have a few pixels and are added pixel by pixel.  The nearest and the farthest layer
// hold the differences of such sums along both axes, where a box is 16 numbers whatever its size (F. Crow,
// "Summed-area tables for texture mapping", SIGGRAPH 1984, the other way round).
//
// STORED: rays are of a file, light in planes of fixed point, LIGHT_ONE to
// one, and codes of depth of type CODE.

#define STEPS 256
#define ONE 1099511627776.0f  // 2^40: the weight of a ray whose cell is open
#define BRIGHTEST ((float)(1 << STOPS))
#define LIGHT (1.0f / (1 << DROPPED))  // of white, over a ray's weight
#define LAYERS (2 * N_BOUNDS + 1)
#define ABREAST 16  // rays of a row

#if STORED
typedef uint light_t;
typedef CODE depth_t;
#define METRES(code) table[code]
#else
typedef float light_t, depth_t;
#define LIGHT_ONE 1.0f
#define METRES(depth) (depth)
#endif

typedef struct {
    float x, y;            // where the ray of pixel (0, 0) falls, in pixels of the picture
    float off_x, off_y;    // from the lens point to the middle of its cell, metres
    float side_x, side_y;  // of the cell, metres
    float share;           // of the cell that is open
    float unused;
} Cell;

typedef struct {
    float delta;   // inverse focus distance
    float scale;   // pixels of the picture, a metre of the lens and a dioptre
    float step;    // pixels of the picture from one pixel of the slab to the next
    float pitch;   // of the lens samples, metres
} Plane;

// Rows of a strip of sums: one more of each layer, where what ends outside is dropped.
typedef struct {
    global long4 *sums;
    int top, rows, width;
    float far;  // beyond every box that reaches a picture
} Strip;

inline Strip make_strip(global long4 *sums, int plane, int strip, int strip_rows, int2 size)
{
    const ulong count = (ulong)(strip_rows + 1) * (size.x + 1);
    const int strips = (size.y + strip_rows - 1) / strip_rows;
    const ulong at = (ulong)(plane * strips + strip) * LAYERS * count;
    const int top = strip * strip_rows;
    return (Strip){sums + at, top, min(strip_rows, size.y - top), size.x, 4.0f * max(size.x, size.y)};
}

inline ulong layer_size(const Strip *s, int strip_rows) { return (ulong)(strip_rows + 1) * (s->width + 1); }

inline int floor_pixel(int edge) { return edge >> 8; }

// The part of [low, high] that lies in a pixel, in 1 / STEPS.
inline int overlap(int low, int high, int pixel)
{
    return min(high, (pixel + 1) * STEPS) - max(low, pixel * STEPS);
}

// A box of at most two pixels along each axis, inside the strip: no loop whose length is guessed.
inline void add_four(const Strip *s, global long4 *to, int4 box, long4 colour)
{
    const int x = floor_pixel(box.x), y = floor_pixel(box.y);
    const int left = min(box.z, (x + 1) * STEPS) - box.x, top = min(box.w, (y + 1) * STEPS) - box.y;
    const int right = box.z - box.x - left, below = box.w - box.y - top;
    global long4 *at = to + (ulong)(y - s->top) * (s->width + 1) + x;
    at[0] += colour * (long)(top * left);
    at[1] += colour * (long)(top * right);
    at += s->width + 1;
    at[0] += colour * (long)(below * left);
    at[1] += colour * (long)(below * right);
}

inline void add_few(const Strip *s, global long4 *to, int4 box, long4 colour)
{
    const int x0 = max(0, floor_pixel(box.x)), x1 = min(s->width - 1, floor_pixel(box.z - 1));
    const int y0 = max(s->top, floor_pixel(box.y)), y1 = min(s->top + s->rows - 1, floor_pixel(box.w - 1));
    for (int y = y0; y <= y1; ++y) {
        const int down = overlap(box.y, box.w, y);
        global long4 *at = to + (ulong)(y - s->top) * (s->width + 1);
        for (int x = x0; x <= x1; ++x) at[x] += colour * (long)(down * overlap(box.x, box.z, x));
    }
}

// Differences of overlap along one axis: at the first pixel and the one behind it, the last and the one behind it.
inline void differences(int low, int high, int first, int count, int at[4], int value[4])
{
    const int a = floor_pixel(low), b = floor_pixel(high - 1);
    const int head = (a + 1) * STEPS - low, tail = high - b * STEPS;
    at[0] = a; at[1] = a + 1; at[2] = b; at[3] = b + 1;
    value[0] = head; value[1] = STEPS - head; value[2] = tail - STEPS; value[3] = -tail;
    for (int k = 0; k < 4; ++k) at[k] = clamp(at[k] - first, 0, count);
}

inline void add_edges(const Strip *s, global long4 *to, int4 box, long4 colour)
{
    int x[4], y[4];
    int along[4], down[4];
    differences(box.x, box.z, 0, s->width, x, along);
    differences(box.y, box.w, s->top, s->rows, y, down);
    for (int j = 0; j < 4; ++j) {
        global long4 *at = to + (ulong)y[j] * (s->width + 1);
        for (int i = 0; i < 4; ++i) at[x[i]] += colour * (long)(down[j] * along[i]);
    }
}

// Whether a layer holds differences.
inline int is_outermost(int layer) { return layer == 0 || layer == LAYERS - 1; }

inline void add_box(const Strip *s, global long4 *to, int outermost, int4 box, long4 colour)
{
    if (outermost) {
        add_edges(s, to, box, colour);
        return;
    }
    const int columns = floor_pixel(box.z - 1) - floor_pixel(box.x) + 1;
    const int rows = floor_pixel(box.w - 1) - floor_pixel(box.y) + 1;
    const int inside = box.x >= 0 && box.y >= s->top * STEPS && box.x < s->width * STEPS &&
                       box.y < (s->top + s->rows) * STEPS;
    if (columns <= 2 && rows <= 2 && inside) add_four(s, to, box, colour);
    else add_few(s, to, box, colour);
}

// The layers of what is swept by so many pixels, the nearest first.
inline int16 layer_of(float16 sweep, constant const float *bounds)
{
    int16 beyond = 0;  // a comparison that holds is -1
    for (int k = 0; k < N_BOUNDS; ++k) beyond -= fabs(sweep) >= bounds[k];
    return N_BOUNDS + select(beyond, -beyond, sweep < 0.0f);
}

// Whole steps; what lies far outside is clamped there: integers must hold it.
inline int16 to_steps(const Strip *s, float16 place)
{
    return convert_int16_rte(clamp(place, -s->far, s->far + s->far) * (float)STEPS);
}

// Add the rays of one row of a view: their boxes are found side by side, and added one by one.
inline void add_row(const Strip *s,
                    int strip_rows,
                    Plane p,
                    Cell cell,
                    float y,
                    int columns,
                    float least,
                    constant const float *bounds,
                    global const light_t *light,
                    ulong channel,
                    int pixel,
                    global const depth_t *depth,
                    global const float *table)
{
    const float16 along = (float16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    for (int start = 0; start < columns; start += ABREAST) {
        const int rays = min(ABREAST, columns - start);
        float z[ABREAST];
        for (int k = 0; k < ABREAST; ++k) z[k] = METRES(depth[start + min(k, rays - 1)]);
        const float16 moves = (p.delta - 1.0f / vload16(0, z)) * p.scale;
        const float16 half_x = 0.5f * max(fabs(moves) * cell.side_x, least);
        const float16 half_y = 0.5f * max(fabs(moves) * cell.side_y, least);
        const float16 x = fma(along + (float)start, p.step, cell.x) + cell.off_x * moves;
        const float16 at_y = y + cell.off_y * moves;
        const int16 left = to_steps(s, x - half_x), top = to_steps(s, at_y - half_y);
        const int16 right = to_steps(s, x + half_x), bottom = to_steps(s, at_y + half_y);
        const int16 wide = right - left, tall = bottom - top;
        const int16 falls = bottom > s->top * STEPS & top < (s->top + s->rows) * STEPS & right > 0 &
                            left < s->width * STEPS & wide > 0 & tall > 0;
        const float16 weight = cell.share * ONE / (convert_float16(wide) * convert_float16(tall));
        int at[4][ABREAST], seen[ABREAST], layer[ABREAST];
        float share[ABREAST];
        vstore16(left, 0, at[0]);
        vstore16(top, 0, at[1]);
        vstore16(right, 0, at[2]);
        vstore16(bottom, 0, at[3]);
        vstore16(falls, 0, seen);
        vstore16(layer_of(moves * p.pitch, bounds), 0, layer);
        vstore16(weight, 0, share);
        for (int k = 0; k < rays; ++k) {
            if (!seen[k]) continue;
            const int4 box = (int4)(at[0][k], at[1][k], at[2][k], at[3][k]);
            global const light_t *from = light + (start + k) * pixel;
            const float3 found = (float3)(from[0], from[channel], from[2 * channel]) / (float)(LIGHT_ONE);
            const float4 colour = (float4)(clamp(found, 0.0f, BRIGHTEST) * LIGHT * share[k], share[k]);
            const float most = STOPS ? max(max(colour.x, colour.y), max(colour.z, colour.w)) : share[k];
            global long4 *to = s->sums + layer[k] * layer_size(s, strip_rows);
            const int outermost = is_outermost(layer[k]);
            // But for the smallest boxes 32 bits hold it, and products of 32 bits cost least.
            if (most < 0x1p30f) add_box(s, to, outermost, box, convert_long4(convert_int4_rte(colour)));
            else add_box(s, to, outermost, box, convert_long4_rte(colour));
        }
    }
}

// Whether any ray of a row, whose depths lie in `range`, reaches the strip.
inline int reaches(const Strip *s, Plane p, Cell cell, float y, float least, float2 range)
{
    const float moves = max(fabs(p.delta - 1.0f / range.x), fabs(p.delta - 1.0f / range.y)) * p.scale;
    const float reach = 0.5f * max(moves * cell.side_y, least) + fabs(cell.off_y) * moves + 1.0f;
    return y + reach >= s->top && y - reach <= s->top + s->rows;
}

kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void add_rays(global const light_t *restrict light,  // (views, rows, columns, 3); (views, 3, rows, columns) if STORED
              global const depth_t *restrict depth,  // (views, rows, columns), metres, or codes
              global const float *restrict table,    // metres of each code
              global const float2 *restrict ranges,  // (views, rows) least and most depth of a row
              global const Cell *restrict cells,     // (planes, views)
              global const Plane *restrict planes,
              constant float *restrict bounds,
              const int n_views,
              const int columns,
              const int rows,
              const int first_row,                   // of the views
              const float least,                     // side of a box, pixels
              const int strip_rows,
              const int width,                       // of the pictures
              const int height,
              global long4 *restrict sums)
{
    const int plane = get_global_id(1);
    const ulong channel = STORED ? (ulong)rows * columns : 1;
    const Strip s = make_strip(sums, plane, get_global_id(0), strip_rows, (int2)(width, height));
    const Plane p = planes[plane];
    for (int view = 0; view < n_views; ++view) {
        const Cell cell = cells[plane * n_views + view];
        if (!(cell.share > 0.0f)) continue;
        for (int v = 0; v < rows; ++v) {
            const float y = fma((float)(first_row + v), p.step, cell.y);
            const ulong row = (ulong)view * rows + v;
            if (!reaches(&s, p, cell, y, least, ranges[row])) continue;
            const ulong at = row * columns;
            global const light_t *of_row = light + (STORED ? 3 * view * channel + (ulong)v * columns : 3 * at);
            add_row(&s, strip_rows, p, cell, y, columns, least, bounds, of_row, channel, STORED ? 1 : 3, depth + at,
                    table);
        }
    }
}

// Pictures from the sums: layers front to back, each taking no more of a pixel than those before it left.
kernel __attribute__((reqd_work_group_size(1, 1, 1))) void compose(global long4 *restrict sums,
                    global const float *restrict room,  // (planes, height, width): weight of all rays that fall there
                    const int strip_rows,
                    const int width,
                    const int height,
                    global float *restrict pictures)    // (planes, height, width, 3)
{
    const int plane = get_global_id(1);
    const Strip s = make_strip(sums, plane, get_global_id(0), strip_rows, (int2)(width, height));
    const ulong pitch = width + 1, size = layer_size(&s, strip_rows);
    const float4 light = (float4)((float3)(ONE * LIGHT), ONE);
    for (int y = 0; y < s.rows; ++y) {
        for (int layer = 0; layer < LAYERS; layer += max(1, LAYERS - 1)) {
            global long4 *row = s.sums + layer * size + y * pitch;
            long4 along = 0;
            for (int x = 0; x < width; ++x) {
                along += row[x];
                row[x] = along;
                if (y) row[x] += row[x - (long)pitch];
            }
        }
        for (int x = 0; x < width; ++x) {
            const ulong at = ((ulong)plane * height + s.top + y) * width + x;
            float left = room[at], filled = 0.0f;
            float3 colour = 0.0f, last = 0.0f;
            for (int layer = 0; layer < LAYERS; ++layer) {
                const ulong from = layer * size + y * pitch + x;
                const float4 found = convert_float4(s.sums[from]) / light;
                const float used = min(found.w, left);
                if (!(used > 0.0f)) continue;
                colour += found.xyz * (used / found.w);
                filled += used;
                left -= used;
                last = found.xyz / found.w;
            }
#if FILL_FAR
            colour += last * left;
            filled += filled > 0.0f ? left : 0.0f;
#endif
            vstore3(filled > 0.0f ? colour / filled : 0.0f, at, pictures);
        }
    }
}
