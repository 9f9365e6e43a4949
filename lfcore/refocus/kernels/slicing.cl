// Algorithms 1 and 4: sensor planes from macropixels, traced or decoded.  A summed-area table is made of
// STRIP rows of lens samples, with those rows only at which a run of some plane ends; each plane takes one
// sum per bin from it.  strip_tables.py defines the bins.  Sums are integers: exact and independent of the
// order.
//
// TRACED is 1 for traced light, 0 for frames; STRIP is as in strip_tables.py.  LANES is 1 or 16: sixteen
// samples fill a register even if it holds only four or eight floats.
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
#define CHUNK 16
#define LEAD 3  // entries before the 0 of a table's row, so that its sums begin at a multiple of 64 bytes
#define PITCH(views) (((views) + CHUNK - 1) / CHUNK * CHUNK + LEAD + 65)
#define GROUP 16

typedef struct {
    int planes;                    // number of planes, sorted by mask
    int strips;                    // of a macropixel
    int left, top, width, height;  // region of the accumulators in plane pixels
    int views;                     // side N of a macropixel
    global const StripPlane *plane;  // (planes,)
    global const int *pointers;
    global const StripRun *runs;
    global const uchar *masks;     // (masks, N, N) 255 where open
    global const uchar *kinds;     // (masks, strips, chunks) 0 closed, 1 partly, 2 wholly open
    global const TableRows *table_rows;  // (masks, strips)
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
    NEXT(0, s0) NEXT(1, s1) NEXT(2, s2) NEXT(3, s3) NEXT(4, s4) NEXT(5, s5) NEXT(6, s6) NEXT(7, s7)
    NEXT(8, s8) NEXT(9, s9) NEXT(10, sa) NEXT(11, sb) NEXT(12, sc) NEXT(13, sd) NEXT(14, se) NEXT(15, sf)
#endif
}

// The summed-area table of a strip, whose first row and first column are 0: a row for each lens row at which
// a run ends, of the sums from the strip's first row.  LANES columns are walked down the strip, their sums in
// registers.
inline void make_strip(const Strips *s, const Macropixel *m, int mask, int strip, global table_sum *table)
{
    const int pitch = PITCH(s->views), chunks = (s->views + CHUNK - 1) / CHUNK, y0 = strip * STRIP;
    global const uchar *kinds = s->kinds + (mask * s->strips + strip) * chunks;
    global const uchar *open = s->masks + ((ulong)mask * s->views + y0) * s->views;
    global const TableRows *ends = s->table_rows + mask * s->strips + strip;
    const int rows = ends->count;
    for (int x = 0; x < s->views; x += LANES) {
        global table_sum *here = table + LEAD + 1 + x;
        const int kind = kinds[x / CHUNK], count = s->views - x;
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
                if (kind == 1) lets = load_mask(open + y * s->views + x, count);
                r += light.r & lets, g += light.g & lets, b += light.b & lets;
            }
            prefix(r, g, b, here + row * pitch);
        }
    }
}

inline void add_strip(const Strips *s, int plane, int strip, int u, int v, global const table_sum *table)
{
    const StripPlane info = s->plane[plane];
    const int pitch = PITCH(s->views);
    global ulong4 *sums = s->sums + (ulong)plane * s->width * s->height;
    global const int *columns = s->pointers + info.columns + (info.per_pixel ? u : 0);
    global const int *rows = s->pointers + info.rows + (info.per_pixel ? v : 0) * s->strips + strip;
    int before_row = 0;
    for (int b = rows[0]; b < rows[1]; ++b) {
        const StripRun down = s->runs[b];
        const int y = v + down.target - s->top;
        global const table_sum *top = table + before_row * pitch + LEAD, *bottom = table + down.end * pitch + LEAD;
        before_row = down.end;
        if (y < 0 || y >= s->height) continue;
        global ulong4 *line = sums + (ulong)y * s->width;
        table_sum before = 0;
        for (int a = columns[0]; a < columns[1]; ++a) {
            const StripRun across = s->runs[a];
            const int x = u + across.target - s->left;
            const table_sum here = bottom[across.end] - top[across.end];
            if (x >= 0 && x < s->width) line[x] += convert_ulong4(here - before);
            before = here;
        }
    }
}

// Add one strip of a macropixel of pixel (u, v); `table` is scratch, (STRIP + 1, PITCH).
inline void add_macropixel(const Strips *s, const Macropixel *m, int strip, int u, int v, global table_sum *table)
{
    int have = -1;
    for (int plane = 0; plane < s->planes; ++plane) {
        const int mask = s->plane[plane].mask;
        if (mask != have) {
            make_strip(s, m, mask, strip, table);
            have = mask;
        }
        add_strip(s, plane, strip, u, v, table);
    }
}

KERNEL
void form_planes(global const stored *restrict rays,
                 const int2 size,                     // of a frame; of traced rays (beside, side)
                 global const Placement *restrict placements,  // (E,)
                 const int n_elements,
                 const int inner,                     // side N of a macropixel
                 global int *restrict next,
                 global uint *restrict scratch,       // (workers, scratch_words): tables
                 const int scratch_words,
                 const SensorPlaneArguments n,
                 global const StripPlane *restrict plane_records,
                 global const int *restrict pointers,
                 global const StripRun *restrict runs,
                 global const uchar *restrict masks,
                 global const uchar *restrict kinds,
                 global const TableRows *restrict table_rows,
                 global ulong4 *restrict sums)
{
    const ulong own = get_global_id(0) * (ulong)n.planes * n.width * n.height;
    const Strips strips = {n.planes, n.strips, n.left, n.top, n.width, n.height, inner,
                           plane_records, pointers, runs, masks, kinds, table_rows, sums + own};
    global table_sum *table = (global table_sum *)(scratch + get_global_id(0) * (ulong)scratch_words);
    const int pitch = PITCH(inner);
    for (int k = 0; k < pitch; ++k) table[k] = 0;
    for (int row = 1; row <= STRIP; ++row) table[row * pitch + LEAD] = 0;
    // Neighbours strip by strip: what a strip adds to, of all planes, then stays in the cache.
    for (int group = atomic_inc(next) * GROUP; group < n_elements; group = atomic_inc(next) * GROUP)
        for (int strip = 0; strip < strips.strips; ++strip)
            for (int element = group; element < min(group + GROUP, n_elements); ++element) {
                const Placement placed = placements[element];
                const Macropixel macropixel = macropixel_at(rays, size, element, placed);
                add_macropixel(&strips, &macropixel, strip, placed.column, placed.row, table);
            }
}
