// Sensor planes from beams of lens samples: rows first, then columns.
//
// The pixel a ray falls on is separable.  A beam is one square picture of GROUP x GROUP pixels times their
// lens samples: every column of it, (u, i), falls on one column of a plane, and every row, (v, j), on one
// row.  Prefix sums down the columns, made once a mask, give what a row of a plane gets from each column of
// the beam, a vector at a time.  Beams of pixels one below the other, through the same lens samples, have
// the same columns: these rows are kept until such a strip of beams is done, and only then go to pixels.
#ifndef LFCORE_BEAM_PLANES_CL
#define LFCORE_BEAM_PLANES_CL
#include "beam.cl"
#include "planes.cl"

#define GROUP (ELEMENTS == 16 ? 4 : ELEMENTS == 4 ? 2 : 1)
#define CHUNKS (GROUP * TILE_SIDE)      // tiles along a side of the beam
#define BEAM_COLUMNS (CHUNKS * BLOCK)   // at most 64
#define PREFIX_PITCH (3 * BEAM_COLUMNS)
#define PREFIX_WORDS ((BEAM_COLUMNS + 1) * PREFIX_PITCH)
#define RECORD 129                      // ints: runs, then of each its target and start + (end << 8)

// Of the beam's tile in `row`, `column` of its picture
inline int tile_at(int row, int column)
{
    return ((row / TILE_SIDE) * GROUP + column / TILE_SIDE) * ELEMENT_TILES + (row % TILE_SIDE) * TILE_SIDE + column % TILE_SIDE;
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
    const int pitch = REACH * ((p->blocks + TILE_SIDE - 1) / TILE_SIDE);
    int any = 0;
    for (int column = 0; column < CHUNKS; ++column) {
        uint16 red = 0, green = 0, blue = 0;
        global uint *to = prefix + column * BLOCK;
        for (int row = 0; row < CHUNKS; ++row) {
            const int tile = tile_at(row, column);
            const int2 where = tile_position(work, tile);
            const int2 at = where / BLOCK;
            const int seen = tile_element(work, tile) >= 0;
            const int kind = seen ? p->kinds[(mask * p->blocks + at.y) * p->blocks + at.x] : 0;
            global const uchar *open = p->masks + ((ulong)mask * pitch + where.y) * pitch + where.x;
            global const float *from = colours + tile * 3 * BLOCK_RAYS;
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
    global uint *rows;    // (planes, ring, 3, BEAM_COLUMNS) zero but for those; row y is at y % ring.  Of
                          // 32 bits: of a column a beam adds 64 rays of 2^20 at the most
    int ring;             // a power of two, no less than the rows of a plane that a strip reaches
} Strip;

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

// Add a beam of linear colours (BEAM_TILES, 3, BLOCK_RAYS) to its strip.  Its first row of pixels is v, a multiple of GROUP;
// `prefix` (PREFIX_WORDS) is scratch.
inline void add_to_strip(const Planes *p, const BeamWork *work, int v, global const float *colours, global uint *prefix, const Strip *strip)
{
    const int square = work->row / REACH;
    int have = -1, any = 0;
    for (int plane = 0; plane < p->planes; ++plane) {
        const int4 info = p->plane[plane];
        if (info.x != have) any = make_prefix(p, work, info.x, colours, prefix);
        have = info.x;
        if (!any) continue;
        global const int *down = p->runs + info.y + (v / GROUP * info.z + square) * RECORD;
        global const int *run = down + 1, *end = run + 2 * down[0];
        global uint *rows = strip->rows + (ulong)plane * strip->ring * PREFIX_PITCH;
        int2 window = strip->window[plane];
        while (run < end) {
            global const int *first = run;
            const int y = v + first[0];
            do run += 2; while (run < end && run[0] == first[0]);
            if (y < p->top || y >= p->top + p->height) continue;  // beside the picture, or of pixels beside the tile
            add_rows(first, (int)(run - first) / 2, prefix, rows + (y & (strip->ring - 1)) * PREFIX_PITCH);
            window = (int2)(min(window.x, y), max(window.y, y + 1));
        }
        strip->window[plane] = window;
    }
}

// A row of a strip, zeroed, as red, green, blue, 0 of every column
inline void take_row(global uint *row, private uint4 *line)
{
    for (int column = 0; column < BEAM_COLUMNS; column += 8, row += 8, line += 8) {
        const uint8 red = vload8(0, row), green = vload8(0, row + BEAM_COLUMNS), blue = vload8(0, row + 2 * BEAM_COLUMNS);
        vstore8((uint8)(0), 0, row);
        vstore8((uint8)(0), 0, row + BEAM_COLUMNS);
        vstore8((uint8)(0), 0, row + 2 * BEAM_COLUMNS);
        // As processors interleave: within each half of a register.
        const uint8 low = (uint8)(0, 8, 1, 9, 4, 12, 5, 13), high = low + (uint8)(2);
        const uint8 even = (uint8)(0, 1, 8, 9, 4, 5, 12, 13), odd = even + (uint8)(2);
        const uint8 rg = shuffle2(red, green, low), b = shuffle2(blue, (uint8)(0), low);
        const uint8 rg2 = shuffle2(red, green, high), b2 = shuffle2(blue, (uint8)(0), high);
        const uint8 c0 = shuffle2(rg, b, even), c1 = shuffle2(rg, b, odd);
        const uint8 c2 = shuffle2(rg2, b2, even), c3 = shuffle2(rg2, b2, odd);
        line[0] = c0.lo;
        line[1] = c1.lo;
        line[2] = c2.lo;
        line[3] = c3.lo;
        line[4] = c0.hi;
        line[5] = c1.hi;
        line[6] = c2.hi;
        line[7] = c3.hi;
    }
}

// Add runs of columns to a row of the plane; `sums` is at the pixel of target 0.
inline void add_columns(global const int *run, global const int *end, const private uint4 *line, global ulong4 *sums)
{
    for (; run < end; run += 2) {
        const int stop = run[1] >> 8;
        int column = run[1] & 255;
        ulong4 sum = convert_ulong4(line[column]);
        while (++column < stop) sum += convert_ulong4(line[column]);
        sums[run[0]] += sum;
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
        global const int *run = across + 1, *end = run + 2 * across[0];
        while (run < end && u + run[0] < p->left) run += 2;
        while (run < end && u + end[-2] >= p->left + p->width) end -= 2;
        for (int y = window.x; y < window.y; ++y) {
            take_row(strip->rows + ((ulong)plane * strip->ring + (y & (strip->ring - 1))) * PREFIX_PITCH, line);
            add_columns(run, end, line, p->sums + ((ulong)plane * p->height + y - p->top) * p->width + (u - p->left));
        }
        strip->window[plane] = (int2)(INT_MAX, 0);
    }
}

#endif
