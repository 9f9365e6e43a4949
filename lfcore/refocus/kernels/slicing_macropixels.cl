// Algorithms 1 and 4: sensor planes from macropixels, traced or decoded.  A summed-area table is
// made of STRIP rows of lens samples, with those rows only at which a run of some plane ends; each
// plane takes one sum per run from it.  strip_tables.py defines the runs.  Sums are integers: exact
// and independent of the order.
//
// TRACED is 1 for traced light, 0 for frames; WIDE_SUMS 1 if sums of a strip exceed 32
// bits.  LANES is 1 or 16: sixteen samples fill a register even if it holds only four or eight floats.
#if TRACED
#include "traced_rays.cl"
#else
#include "decoded_rays.cl"
#endif

#if WIDE_SUMS
typedef ulong4 table_sum;  // of a summed-area table
#define TO_TABLE_SUM convert_ulong4
#else
typedef uint4 table_sum;
#define TO_TABLE_SUM
#endif
#define PITCH(views) (((views) + CHUNK - 1) / CHUNK * CHUNK + TABLE_PADDING)
#define GROUP 16  // macropixels whose strips are added in turn

typedef struct {
    const SensorPlaneArguments *numbers;
    global const StripPlane *planes;
    global const int *pointers;
    global const StripRun *runs;
    global const uchar *masks, *kinds;
    global const TableRows *table_rows;
    global ulong4 *sums;           // (planes, height, width) of this worker
} Strips;

// All bits where the mask is open, 0 where not and beyond it.
inline vu load_mask(global const uchar *at, int count)
{
#if LANES > 1
    if (count >= LANES) return as_uint16(convert_int16(as_char16(vload16(0, at))));
#endif
    private uint open[LANES];
    for (int k = 0; k < LANES; ++k) open[k] = k < count && at[k] ? 0xffffffffu : 0u;
    return VLOAD(open);
}

// here[k] = here[-1] + the sum of rays 0 ... k of a row of LANES.
inline void prefix(vu r, vu g, vu b, global table_sum *here)
{
    table_sum sum = here[-1];
#if LANES == 1
    *here = sum + (table_sum)(r, g, b, 0);
#else
#define NEXT(k, i) sum += (table_sum)(r.i, g.i, b.i, 0), here[k] = sum;
    NEXT(0, s0) NEXT(1, s1) NEXT(2, s2) NEXT(3, s3) NEXT(4, s4) NEXT(5, s5) NEXT(6, s6)
    NEXT(7, s7) NEXT(8, s8) NEXT(9, s9) NEXT(10, sa) NEXT(11, sb) NEXT(12, sc) NEXT(13, sd)
    NEXT(14, se) NEXT(15, sf)
#endif
}

// The summed-area table of a strip, whose first row and first column are 0: a row for each lens row
// at which a run ends, of the sums from the strip's first row.  LANES columns are walked down the
// strip, their sums in registers.
inline void make_table(const Strips *s, const Macropixel *m, int mask, int strip,
                       global table_sum *table)
{
    const int views = s->numbers->views, strips = s->numbers->strips, y0 = strip * STRIP;
    const int pitch = PITCH(views), chunks = (views + CHUNK - 1) / CHUNK;
    global const uchar *kinds = s->kinds + (mask * strips + strip) * chunks;
    global const uchar *open = s->masks + ((ulong)mask * views + y0) * views;
    global const TableRows *ends = s->table_rows + mask * strips + strip;
    const int rows = ends->count;
    for (int x = 0; x < views; x += LANES) {
        global table_sum *here = table + TABLE_LEAD + 1 + x;
        const int kind = kinds[x / CHUNK], count = views - x;
        vu r = 0, g = 0, b = 0;
        if (!kind) {
            for (int row = 1; row <= rows; ++row) prefix(r, g, b, here + row * pitch);
            continue;
        }
        Row light;
        for (int row = 1, y = 0; row <= rows; ++row) {
            for (const int end = ends->end[row - 1]; y < end; ++y) {
                next_row(m, x, y0 + y, count, y == 0, &light);
                vu lets = (vu)(0xffffffffu);
                if (kind == 1) lets = load_mask(open + y * views + x, count);
                r += light.r & lets, g += light.g & lets, b += light.b & lets;
            }
            prefix(r, g, b, here + row * pitch);
        }
    }
}

inline void add_strip(const Strips *s, int plane, int strip, int u, int v,
                      global const table_sum *table)
{
    const SensorPlaneArguments *n = s->numbers;
    const StripPlane info = s->planes[plane];
    const int pitch = PITCH(n->views), row = (info.per_pixel ? v : 0) * n->strips + strip;
    global ulong4 *sums = s->sums + (ulong)plane * n->width * n->height;
    global const int *columns = s->pointers + info.columns + (info.per_pixel ? u : 0);
    global const int *rows = s->pointers + info.rows + row;
    int before_row = 0;
    for (int b = rows[0]; b < rows[1]; ++b) {
        const StripRun down = s->runs[b];
        const int y = v + down.target - n->top;
        global const table_sum *top = table + before_row * pitch + TABLE_LEAD;
        global const table_sum *bottom = table + down.end * pitch + TABLE_LEAD;
        before_row = down.end;
        if (y < 0 || y >= n->height) continue;
        global ulong4 *line = sums + (ulong)y * n->width;
        table_sum before = 0;
        for (int a = columns[0]; a < columns[1]; ++a) {
            const StripRun across = s->runs[a];
            const int x = u + across.target - n->left;
            const table_sum here = bottom[across.end] - top[across.end];
            if (x >= 0 && x < n->width) line[x] += convert_ulong4(here - before);
            before = here;
        }
    }
}

// Add one strip of a macropixel of pixel (u, v); `table` is scratch, (STRIP + 1, PITCH).
inline void add_macropixel(const Strips *s, const Macropixel *m, int strip, int u, int v,
                           global table_sum *table)
{
    int have = -1;
    for (int plane = 0; plane < s->numbers->planes; ++plane) {
        const int mask = s->planes[plane].mask;
        if (mask != have) {
            make_table(s, m, mask, strip, table);
            have = mask;
        }
        add_strip(s, plane, strip, u, v, table);
    }
}

KERNEL void form_strip_planes(form_strip_planes_PARAMETERS)
{
    const ulong own = get_global_id(0) * (ulong)numbers.planes * numbers.width * numbers.height;
    const Strips strips = {&numbers, planes, pointers, runs, masks, kinds, table_rows, sums + own};
    const ulong words = get_global_id(0) * (ulong)numbers.scratch_words;
    global table_sum *table = (global table_sum *)(scratch + words);
    const int pitch = PITCH(numbers.views), elements = numbers.elements;
    for (int k = 0; k < pitch; ++k) table[k] = 0;
    for (int row = 1; row <= STRIP; ++row) table[row * pitch + TABLE_LEAD] = 0;
    // Strip by strip over neighbouring macropixels: the sums of all planes stay in the cache.
    for (int group = atomic_inc(next) * GROUP; group < elements; group = atomic_inc(next) * GROUP)
        for (int strip = 0; strip < numbers.strips; ++strip)
            for (int element = group; element < min(group + GROUP, elements); ++element) {
                const Placement placed = placements[element];
                const Macropixel macropixel = macropixel_at(rays, &numbers, element, placed);
                add_macropixel(&strips, &macropixel, strip, placed.column, placed.row, table);
            }
}
