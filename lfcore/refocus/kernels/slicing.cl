// Algorithm 4: sensor planes from decoded frames that hold macropixels.  A summed-area table is made of
// STRIP rows of lens samples, from which each plane takes one sum a bin; strip_tables.py says which lens
// samples make a bin.  As in planes.cl sums are integers: exact, in whatever order they are added.
//
// BITS and RGB are as in light.cl, CHROMA is 1 (4:4:4) or 2 (4:2:0), STRIP as in strip_tables.py.
#include "light.cl"

#define CHUNK 16
#define LEAD 3  // entries before the 0 of a table's row, so that its sums begin at a multiple of 64 bytes
#define PITCH(views) (((views) + CHUNK - 1) / CHUNK * CHUNK + LEAD + 65)
#define GROUP 16

typedef struct {
    int planes;                    // number of planes, sorted by mask
    int strips;                    // of a macropixel
    int left, top, width, height;  // region of the accumulators in plane pixels
    int size;                      // side M of a plane
    int views;                     // side N of a macropixel
    global const int4 *plane;      // (planes,) mask, pointers of columns, pointers of rows, runs per pixel
    global const int *pointers;
    global const int2 *runs;       // one past the last sample, offset
    global const uchar *masks;     // (masks, N, N) 255 where open
    global const uchar *kinds;     // (masks, strips, chunks) 0 closed, 1 partly, 2 wholly open
    global ulong4 *sums;           // (planes, height, width) of this worker
} Strips;

typedef struct {
    global const sample *first, *second, *third;  // planes of the frame
    int width;                                    // of a row of `first`
    int x0, y0;                                   // corner of the macropixel
} Macropixel;

#if LANES == 16
#define HALF_LANES 8
#define DOUBLED(x) x.s00112233, x.s44556677
#elif LANES == 8
#define HALF_LANES 4
#define DOUBLED(x) x.s00112233
#elif LANES == 4
#define HALF_LANES 2
#define DOUBLED(x) x.s0011
#endif

// LANES samples of a row, all of them within the frame; of subsampled planes each twice.
inline vf load_samples(global const sample *at, int twice)
{
#if LANES == 1
    return convert_float(*at) * SCALE;
#else
#if CHROMA == 2
    if (twice) {
        const JOIN(float, HALF_LANES) x = JOIN(convert_float, HALF_LANES)(JOIN(vload, HALF_LANES)(0, at)) * SCALE;
        return (vf)(DOUBLED(x));
    }
#endif
    return JOIN(convert_float, LANES)(JOIN(vload, LANES)(0, at)) * SCALE;
#endif
}

// Where a row of a macropixel ends, or with one lane.
inline vf load_tail(global const sample *at, int step, int count)
{
    private float row[LANES];
    for (int k = 0; k < LANES; ++k) row[k] = (float)at[clamp(k, 0, max(count - 1, 0)) / step] * SCALE;
    return VLOAD(row);
}

// Fixed-point light of LANES rays of row y from column x, `count` of them in the macropixel; rays outside
// the mask, if there is one, are dark.
inline void load_light(const Macropixel *m, int x, int y, int count, global const uchar *mask, vu *r, vu *g, vu *b)
{
    const ulong full = (ulong)(m->y0 + y) * m->width + m->x0 + x;
    const ulong small = (ulong)((m->y0 + y) / CHROMA) * (m->width / CHROMA) + (m->x0 + x) / CHROMA;
    vf first, second, third;
    if (count >= LANES && LANES > 1) {
        first = load_samples(m->first + full, 0);
        second = load_samples(m->second + small, 1);
        third = load_samples(m->third + small, 1);
    } else {
        first = load_tail(m->first + full, 1, count);
        second = load_tail(m->second + small, CHROMA, count);
        third = load_tail(m->third + small, CHROMA, count);
    }
    TO_RGB(vf, first, second, third, red, green, blue);
    *r = linear_row(red), *g = linear_row(green), *b = linear_row(blue);
    if (mask) {
        private uint open[LANES];
        for (int k = 0; k < LANES; ++k) open[k] = k < count && mask[k] ? 0xffffffffu : 0u;
        const vu lets = VLOAD(open);
        *r &= lets, *g &= lets, *b &= lets;
    }
}

#if LANES == 16
// Four rays in a row of registers: each adds the one before it, then the two before those, then all before.
#define FOUR(k, i, j, m, n)                                                                             \
    {                                                                                                   \
        uint16 x = (uint16)(r.i, g.i, b.i, 0, r.j, g.j, b.j, 0, r.m, g.m, b.m, 0, r.n, g.n, b.n, 0);    \
        x += (uint16)(none.s0123, x.s01234567, x.s89ab);                                                \
        x += (uint16)(none.s01234567, x.s01234567);                                                     \
        x += carry;                                                                                     \
        carry = x.scdefcdefcdefcdef;                                                                    \
        vstore16(x + vload16(0, (global const uint *)(above + k)), 0, (global uint *)(here + k));       \
    }
#endif

// here[k] = above[k] + the sum of rays 0 ... k of a row of LANES + `before`; returns that of all.
inline uint4 prefix(vu r, vu g, vu b, uint4 before, global const uint4 *above, global uint4 *here, int count)
{
#if LANES == 16
    if (count >= LANES) {
        const uint16 none = 0;
        uint16 carry = (uint16)(before, before, before, before);
        FOUR(0, s0, s1, s2, s3)
        FOUR(4, s4, s5, s6, s7)
        FOUR(8, s8, s9, sa, sb)
        FOUR(12, sc, sd, se, sf)
        return carry.s0123;
    }
#endif
    private uint light[3 * LANES];
    VSTORE(r, light), VSTORE(g, light + LANES), VSTORE(b, light + 2 * LANES);
    for (int k = 0; k < min(count, LANES); ++k) {
        before += (uint4)(light[k], light[LANES + k], light[2 * LANES + k], 0);
        here[k] = before + above[k];
    }
    return before;
}

// Prefix sums of `rows` rows of a strip: (STRIP + 1, PITCH), whose first row and first column are 0.
inline void make_strip(const Strips *s, const Macropixel *m, int mask, int strip, int rows, global uint4 *table)
{
    const int pitch = PITCH(s->views), chunks = (s->views + CHUNK - 1) / CHUNK, y0 = strip * STRIP;
    global const uchar *kinds = s->kinds + (mask * s->strips + strip) * chunks;
    for (int row = 0; row < rows; ++row) {
        global uint4 *above = table + row * pitch + LEAD + 1, *here = above + pitch;
        global const uchar *open = s->masks + ((ulong)mask * s->views + y0 + row) * s->views;
        uint4 sum = 0;
        for (int x = 0; x < s->views; x += LANES) {
            const int count = s->views - x, kind = kinds[x / CHUNK];
            if (kind) {
                vu r, g, b;
                load_light(m, x, y0 + row, count, kind == 2 ? 0 : open + x, &r, &g, &b);
                sum = prefix(r, g, b, sum, above + x, here + x, count);
            } else {
                for (int k = 0; k < min(count, LANES); ++k) here[x + k] = sum + above[x + k];
            }
        }
    }
}

inline void add_strip(const Strips *s, int plane, int strip, int u, int v, global const uint4 *table)
{
    const int4 info = s->plane[plane];
    const int pitch = PITCH(s->views);
    global ulong4 *sums = s->sums + (ulong)plane * s->width * s->height;
    global const int *columns = s->pointers + info.y + (info.w ? u : 0);
    global const int *rows = s->pointers + info.z + (info.w ? v : 0) * s->strips + strip;
    int before_row = 0;
    for (int b = rows[0]; b < rows[1]; ++b) {
        const int2 down = s->runs[b];
        const int after_row = down.x - strip * STRIP, y = v + down.y;
        global const uint4 *top = table + before_row * pitch + LEAD, *bottom = table + after_row * pitch + LEAD;
        before_row = after_row;
        if (y < 0 || y >= s->size) continue;
        global ulong4 *line = sums + (y - s->top) * s->width - s->left;
        uint4 before = 0;
        for (int a = columns[0]; a < columns[1]; ++a) {
            const int2 across = s->runs[a];
            const int x = u + across.y;
            const uint4 here = bottom[across.x] - top[across.x];
            if (x >= 0 && x < s->size) line[x] += convert_ulong4(here - before);
            before = here;
        }
    }
}

// Add one strip of a macropixel of pixel (u, v); `table` is scratch, (STRIP + 1, PITCH).
inline void add_macropixel(const Strips *s, const Macropixel *m, int strip, int u, int v, global uint4 *table)
{
    int have = -1;
    for (int plane = 0; plane < s->planes; ++plane) {
        const int mask = s->plane[plane].x;
        if (mask != have) {
            make_strip(s, m, mask, strip, min(STRIP, s->views - strip * STRIP), table);
            have = mask;
        }
        add_strip(s, plane, strip, u, v, table);
    }
}

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void form_planes(global const sample *restrict frames,
                 const int frame_width,
                 const int frame_height,
                 global const int4 *restrict places,  // (E,) frame, x0, y0, pixel u + (v << 16)
                 const int n_elements,
                 const int inner,                     // side N of a macropixel
                 global int *restrict next,
                 global uint *restrict scratch,       // (workers, scratch_words): tables
                 const int scratch_words,
                 const int n_planes,
                 const int8 region,                   // left, top, width, height, size M, strips, views N, 0
                 global const int4 *restrict plane_info,
                 global const int *restrict pointers,
                 global const int2 *restrict runs,
                 global const uchar *restrict masks,
                 global const uchar *restrict kinds,
                 global ulong4 *restrict sums)
{
    const Strips strips = {n_planes, region.s5, region.s0, region.s1, region.s2, region.s3, region.s4, inner, plane_info, pointers, runs,
                           masks, kinds, sums + get_global_id(0) * (ulong)n_planes * region.s2 * region.s3};
    global uint4 *table = (global uint4 *)(scratch + get_global_id(0) * (ulong)scratch_words);
    const int pitch = PITCH(inner);
    for (int k = 0; k < pitch; ++k) table[k] = 0;
    for (int row = 1; row <= STRIP; ++row) table[row * pitch + LEAD] = 0;
    const ulong pixels = (ulong)frame_width * frame_height, small = pixels / (CHROMA * CHROMA);
    // Neighbours strip by strip: what a strip adds to, of all planes, then stays in the cache.
    for (int group = atomic_inc(next) * GROUP; group < n_elements; group = atomic_inc(next) * GROUP)
        for (int strip = 0; strip < strips.strips; ++strip)
            for (int element = group; element < min(group + GROUP, n_elements); ++element) {
                const int4 place = places[element];
                global const sample *frame = frames + place.x * (pixels + 2 * small);
                const Macropixel macropixel = {frame, frame + pixels, frame + pixels + small, frame_width, place.y, place.z};
                add_macropixel(&strips, &macropixel, strip, place.w & 0xffff, place.w >> 16, table);
            }
}
