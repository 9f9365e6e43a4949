// Sensor planes from beams of lens samples: rows first, then columns.
//
// The pixel a ray falls on is separable.  A beam is one square picture of GROUP x GROUP pixels times their
// lens samples: every column of it, (u, i), falls on one column of a plane, and every row, (v, j), on one
// row.  Prefix sums down the columns, made once a mask, give what a row of a plane gets from each column of
// the beam, a vector at a time.  Beams one below the other have the same columns, so these rows are kept
// until such a strip of beams is done; only then do they go to the plane's pixels.
#ifndef LFCORE_BEAM_PLANES_CL
#define LFCORE_BEAM_PLANES_CL
#include "beam.cl"
#include "planes.cl"

#define GROUP (ELEMENTS == 16 ? 4 : ELEMENTS == 4 ? 2 : 1)
#define CHUNKS (GROUP * SIDE)           // blocks along a side of the beam
#define BEAM_COLUMNS (CHUNKS * BLOCK)   // at most 64
#define PREFIX_PITCH (3 * BEAM_COLUMNS)
#define PREFIX_WORDS ((BEAM_COLUMNS + 1) * PREFIX_PITCH)
#define RECORD 129                      // ints: runs, then of each its target and start + (end << 8)

// Of the beam's block in `row`, `column` of its picture
inline int block_at(int row, int column)
{
    return ((row / SIDE) * GROUP + column / SIDE) * ELEMENT_BLOCKS + (row % SIDE) * SIDE + column % SIDE;
}

// Leave out blocks of a beam that no plane's mask opens.
inline void drop_closed_blocks(const Planes *p, BeamWork *work)
{
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        if (work->block[block].z_far < 0.0f) continue;
        const int2 at = block_position(work, block) / BLOCK;
        int open = 0;
        for (int plane = 0; plane < p->planes; ++plane) open |= p->kinds[(p->plane[plane].x * p->blocks + at.y) * p->blocks + at.x];
        if (!open) work->block[block].z_far = -1.0f;
    }
}

// Exclusive prefix sums down the columns of fixed-point colours where the mask is open: (rows + 1, 3,
// columns), each below 2^27.  Returns whether anything is open.
inline int make_prefix(const Planes *p, const BeamWork *work, int mask, global const float *colours, global uint *prefix)
{
    const int pitch = SIDE * BLOCK * ((p->blocks + SIDE - 1) / SIDE);
    int any = 0;
    for (int column = 0; column < CHUNKS; ++column) {
        uint16 red = 0, green = 0, blue = 0;
        global uint *to = prefix + column * BLOCK;
        for (int row = 0; row < CHUNKS; ++row) {
            const int block = block_at(row, column);
            const int2 where = block_position(work, block);
            const int2 at = where / BLOCK;
            const int seen = work->block[block].z_far >= 0.0f;
            const int kind = seen ? p->kinds[(mask * p->blocks + at.y) * p->blocks + at.x] : 0;
            global const uchar *open = p->masks + ((ulong)mask * pitch + where.y) * pitch + where.x;
            global const float *from = colours + block * 3 * BLOCK_RAYS;
            any |= kind;
            for (int k = 0; k < BLOCK; ++k, to += PREFIX_PITCH, open += pitch, from += BLOCK) {
                vstore16(red, 0, to);
                vstore16(green, 0, to + BEAM_COLUMNS);
                vstore16(blue, 0, to + 2 * BEAM_COLUMNS);
                if (!kind) continue;
                const int16 keep = kind == 2 ? (int16)(-1) : convert_int16(as_char16(vload16(0, open)));
#define FIXED(at) as_uint16(convert_int16(fma(vload16(0, at), (float16)(FIXED_ONE), (float16)(0.5f))) & keep)
                red += FIXED(from);
                green += FIXED(from + BLOCK_RAYS);
                blue += FIXED(from + 2 * BLOCK_RAYS);
#undef FIXED
            }
        }
        vstore16(red, 0, to);
        vstore16(green, 0, to + BEAM_COLUMNS);
        vstore16(blue, 0, to + 2 * BEAM_COLUMNS);
    }
    return any;
}

// A strip's sums before they go to pixels, of this worker.
typedef struct {
    global int2 *window;  // (planes,) first row and one past the last that hold anything; first >= last: none
    global uint *rows;    // (planes, height, 3, BEAM_COLUMNS) zero but for those
} Strip;

#define STRIP_BEAMS 32                  // at most: each adds up to 64 rays of 2^20 to a sum of 32 bits

// Add the beam's rows of the `count` runs from `run` on to a row of the strip.
inline void add_rows(global const int *run, int count, global const uint *prefix, global uint *to)
{
    for (int channel = 0; channel < 3; ++channel, prefix += BEAM_COLUMNS, to += BEAM_COLUMNS) {
        uint16 sum[CHUNKS];
#pragma unroll
        for (int k = 0; k < CHUNKS; ++k) sum[k] = vload16(k, to);
        for (int at = 0; at < count; ++at) {
            const int span = run[2 * at + 1];
            global const uint *above = prefix + (span & 255) * PREFIX_PITCH, *below = prefix + (span >> 8) * PREFIX_PITCH;
#pragma unroll
            for (int k = 0; k < CHUNKS; ++k) sum[k] += vload16(k, below) - vload16(k, above);
        }
#pragma unroll
        for (int k = 0; k < CHUNKS; ++k) vstore16(sum[k], k, to);
    }
}

// Add a beam of linear colours (BEAM_BLOCKS, 3, BLOCK_RAYS), of blocks whose z_far is not negative, to
// its strip.  Its first row of pixels is v, a multiple of GROUP; `prefix` (PREFIX_WORDS) is scratch.
inline void add_to_strip(const Planes *p, const BeamWork *work, int v, global const float *colours, global uint *prefix, const Strip *strip)
{
    const int square = work->row / (SIDE * BLOCK);
    int have = -1, any = 0;
    for (int plane = 0; plane < p->planes; ++plane) {
        const int4 info = p->plane[plane];
        if (info.x != have) any = make_prefix(p, work, info.x, colours, prefix);
        have = info.x;
        if (!any) continue;
        global const int *down = p->runs + info.y + (v / GROUP * info.z + square) * RECORD;
        global const int *run = down + 1, *end = run + 2 * down[0];
        global uint *rows = strip->rows + ((ulong)plane * p->height - p->top) * PREFIX_PITCH;
        int2 window = strip->window[plane];
        while (run < end) {
            global const int *first = run;
            const int y = v + first[0];
            do run += 2; while (run < end && run[0] == first[0]);
            if (y < p->top || y >= p->top + p->height) continue;  // beside the picture, or of pixels beside the tile
            add_rows(first, (int)(run - first) / 2, prefix, rows + (long)y * PREFIX_PITCH);
            window = (int2)(min(window.x, y), max(window.y, y + 1));
        }
        strip->window[plane] = window;
    }
}

// A row of a strip, zeroed, as red, green, blue, 0 of every column
inline void take_row(global uint *row, private uint4 *line)
{
    for (int column = 0; column < BEAM_COLUMNS; column += BLOCK) {
        global uint *from = row + column;
        const uint16 red = vload16(0, from), green = vload16(0, from + BEAM_COLUMNS), blue = vload16(0, from + 2 * BEAM_COLUMNS);
        vstore16((uint16)(0), 0, from);
        vstore16((uint16)(0), 0, from + BEAM_COLUMNS);
        vstore16((uint16)(0), 0, from + 2 * BEAM_COLUMNS);
        private uint *to = (private uint *)(line + column);
#define FOUR(k, a, b, c, d)                                                                          \
    vstore16((uint16)(red.a, green.a, blue.a, 0, red.b, green.b, blue.b, 0, red.c, green.c, blue.c, 0, \
                      red.d, green.d, blue.d, 0), k, to);
        FOUR(0, s0, s1, s2, s3)
        FOUR(1, s4, s5, s6, s7)
        FOUR(2, s8, s9, sa, sb)
        FOUR(3, sc, sd, se, sf)
#undef FOUR
    }
}

// Add a line of columns to a row of the plane; `sums` is at pixel 0 of that row.
inline void add_columns(global const int *across, int u, int left, int right, const private uint4 *line, global ulong4 *sums)
{
    global const int *run = across + 1, *end = run + 2 * across[0];
    for (; run < end; run += 2) {
        const int x = u + run[0], stop = run[1] >> 8;
        int column = run[1] & 255;
        if (x < left || x >= right) continue;
        ulong4 sum = convert_ulong4(line[column]);
        while (++column < stop) sum += convert_ulong4(line[column]);
        sums[x] += sum;
    }
}

// Add a strip to the planes and empty it.  Its first column of pixels is u, a multiple of GROUP; `square`
// is its place on the lens.
inline void finish_strip(const Planes *p, int u, int square, const Strip *strip)
{
    private uint4 line[BEAM_COLUMNS];
    for (int plane = 0; plane < p->planes; ++plane) {
        const int4 info = p->plane[plane];
        const int2 window = strip->window[plane];
        global const int *across = p->runs + info.y + (u / GROUP * info.z + square) * RECORD;
        for (int y = window.x; y < window.y; ++y) {
            const ulong row = (ulong)plane * p->height + (y - p->top);
            take_row(strip->rows + row * PREFIX_PITCH, line);
            add_columns(across, u, p->left, p->left + p->width, line, p->sums + row * p->width - p->left);
        }
        strip->window[plane] = (int2)(INT_MAX, 0);
    }
}

#endif
