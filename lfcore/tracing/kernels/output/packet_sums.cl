// Sensor planes from packets of lens samples: rows first, then columns.
//
// The pixel that a ray falls on is separable.  A packet is a square picture of its pixels times
// their lens samples: each column of the picture, (u, i), falls on one column of a plane, and each
// row, (v, j), on one row.  Prefix sums down the columns, made once per mask, give what a row of a
// plane gets from each column of the packet, a vector at a time.  Packets of pixels one below the
// other, through the same lens samples, have the same columns: these rows are kept until such a
// strip of packets is done, and only then go to pixels.
//
// Source of prefix sums: F. C. Crow, "Summed-Area Tables for Texture Mapping", SIGGRAPH 1984.
#pragma once
#include "packet.cl"
#include "plane_sums.cl"

// How far a mask is open over the lens samples of a cell.
inline int openness(const SensorPlanes *p, int mask, int2 at)
{
    const int blocks = p->numbers->blocks;
    return p->kinds[(mask * blocks + at.y / BLOCK) * blocks + at.x / BLOCK];
}

// Leave out blocks of a packet that no plane's mask opens.
inline void drop_closed_blocks(const SensorPlanes *p, Packet *packet)
{
    for (int block = 0; block < packet->rays->blocks; ++block) {
        if (!has_block(packet, block)) continue;
        int open = 0;
        for (int plane = 0; plane < p->numbers->planes; ++plane)
            open |= openness(p, p->plane[plane].mask, block_position(packet, block));
        if (!open) packet->blocks &= ~(1u << block);
    }
}

inline void store_prefix(private const uint16 *sum, int column, global ColourRow *to)
{
    for (int channel = 0; channel < 3; ++channel)
        vstore16(sum[channel], column, to->channel[channel]);
}

// Exclusive prefix sums down the columns of fixed-point colours where the mask is open: (rows + 1,)
// rows, each below 2^27, or 2^32 above white.  Returns whether anything is open.
inline int make_prefix(const SensorPlanes *p, const Packet *packet, int mask,
                       global const float *colours, global ColourRow *prefix)
{
    const Rays *rays = packet->rays;
    const int side = rays->packet_side / BLOCK, cells = rays->group_side * side;
    const int pitch = rays->packet_side * ((p->numbers->blocks + side - 1) / side);
    int any = 0;
    for (int column = 0; column < cells; ++column) {
        uint16 sum[3] = {0, 0, 0};
        for (int row = 0; row < cells; ++row) {
            const int element = row / side * rays->group_side + column / side;
            const int cell = (element * side + row % side) * side + column % side;
            const int2 where = cell_position(packet, cell);
            const int kind = cell_element(packet, cell) >= 0 ? openness(p, mask, where) : 0;
            global const uchar *open = p->masks + ((ulong)mask * pitch + where.y) * pitch + where.x;
            global const float *from = colours + cell * 3 * BLOCK_RAYS;
            global ColourRow *to = prefix + row * BLOCK;
            any |= kind;
            store_prefix(sum, column, to++);
            // No run begins beside the inner grid, and none but the last ends there.
            const int rows = min(rays->rows - where.y, BLOCK);
            for (int k = 0; k < rows; ++k, open += pitch, from += BLOCK) {
                int16 keep = -1;
                if (kind == 1) keep = convert_int16(as_char16(vload16(0, open)));
                for (int channel = 0; channel < 3 && kind; ++channel) {
                    const float16 row = vload16(0, from + channel * BLOCK_RAYS);
                    const int16 fixed = convert_int16(fma(row, (float16)(ONE_OF_SUMS), HALVES));
                    sum[channel] += as_uint16(fixed & keep);
                }
                store_prefix(sum, column, to++);
            }
        }
        store_prefix(sum, column, prefix + cells * BLOCK);
    }
    return any;
}

// A strip's sums before they go to pixels, of this worker.
typedef struct {
    // (planes,) first row and one past the last that hold anything; first >= last: none.
    global int2 *window;
    // (planes, ring) zero but for those rows; row y is at y % ring.  32 bits will do: of a column a
    // packet adds 64 rays of 2^20 at the most, or 2^25 above white (StripBuffers).
    global ColourRow *rows;
    int u;  // first column of its pixels, a multiple of the packets' group
} Strip;

// Add the packet's rows of the `count` runs from `run` on to a row of the strip.
inline void add_rows(global const Run *run, int count, global const ColourRow *prefix,
                     global ColourRow *row)
{
    for (int channel = 0; channel < 3; ++channel) {
        global uint *to = row->channel[channel];
        uint16 sum[MOST_CELLS];
#pragma unroll
        for (int k = 0; k < MOST_CELLS; ++k) sum[k] = vload16(k, to);
        for (int at = 0; at < count; ++at) {
            global const uint *above = prefix[run[at].start].channel[channel];
            global const uint *below = prefix[run[at].end].channel[channel];
#pragma unroll
            for (int k = 0; k < MOST_CELLS; ++k) sum[k] += vload16(k, below) - vload16(k, above);
        }
#pragma unroll
        for (int k = 0; k < MOST_CELLS; ++k) vstore16(sum[k], k, to);
    }
}

// Where the rows, or columns, of packet `number` along an axis of the inner grid fall on a plane.
inline global const Runs *runs_of(const SensorPlanes *p, int plane, int group_side, int pixel,
                                  int number)
{
    const SensorPlane info = p->plane[plane];
    return (global const Runs *)(p->runs + info.runs) + pixel / group_side * info.stride + number;
}

// The row of a strip that holds row y of a plane.
inline global ColourRow *strip_row(const SensorPlanes *p, const Strip *strip, int plane, int y)
{
    const int ring = p->numbers->ring;
    return strip->rows + (ulong)plane * ring + (y & (ring - 1));
}

// Add a packet of linear colours (cells, 3, BLOCK_RAYS) to its strip.  Its first row of
// pixels is v, a multiple of its group; `prefix` (PACKET_COLUMNS + 1,) is scratch.
inline void add_to_strip(const SensorPlanes *p, const Packet *packet, int v,
                         global const float *colours, global ColourRow *prefix, const Strip *strip)
{
    const SensorPlaneArguments *n = p->numbers;
    const Rays *rays = packet->rays;
    const int number = packet->at.y / rays->packet_side;
    int have = -1, any = 0;
    for (int plane = 0; plane < n->planes; ++plane) {
        const int mask = p->plane[plane].mask;
        if (mask != have) any = make_prefix(p, packet, mask, colours, prefix);
        have = mask;
        if (!any) continue;
        global const Runs *rows = runs_of(p, plane, rays->group_side, v, number);
        global const Run *run = rows->run, *end = run + rows->count;
        int2 window = strip->window[plane];
        while (run < end) {
            global const Run *first = run;
            const int y = v + first->target;
            do ++run; while (run < end && run->target == first->target);
            // Rows may lie beside the picture, or be of pixels beside the tile.
            if (y < n->top || y >= n->top + n->height) continue;
            add_rows(first, (int)(run - first), prefix, strip_row(p, strip, plane, y));
            window = (int2)(min(window.x, y), max(window.y, y + 1));
        }
        strip->window[plane] = window;
    }
}

// A row of a strip, zeroed, as red, green, blue, 0 of every column
inline void take_row(global ColourRow *row, private uint4 *line)
{
    for (int k = 0; k < PACKET_COLUMNS / 8; ++k, line += 8) {
        const uint8 red = vload8(k, row->channel[0]), green = vload8(k, row->channel[1]);
        const uint8 blue = vload8(k, row->channel[2]);
        for (int channel = 0; channel < 3; ++channel) vstore8((uint8)(0), k, row->channel[channel]);
        // As processors interleave: within each half of a register.
        const uint8 low = (uint8)(0, 8, 1, 9, 4, 12, 5, 13), high = low + (uint8)(2);
        const uint8 even = (uint8)(0, 1, 8, 9, 4, 5, 12, 13), odd = even + (uint8)(2);
        const uint8 rg = shuffle2(red, green, low), b = shuffle2(blue, (uint8)(0), low);
        const uint8 rg2 = shuffle2(red, green, high), b2 = shuffle2(blue, (uint8)(0), high);
        const uint8 pairs[4] = {shuffle2(rg, b, even), shuffle2(rg, b, odd),
                                shuffle2(rg2, b2, even), shuffle2(rg2, b2, odd)};
        for (int pair = 0; pair < 4; ++pair) {
            line[pair] = pairs[pair].lo;
            line[pair + 4] = pairs[pair].hi;
        }
    }
}

// Add runs of columns to a row of the plane; `sums` is at the pixel of target 0.
inline void add_columns(global const Run *run, global const Run *end, const private uint4 *line,
                        global ulong4 *sums)
{
    for (; run < end; ++run) {
        const int stop = run->end;
        int column = run->start;
        ulong4 sum = convert_ulong4(line[column]);
        while (++column < stop) sum += convert_ulong4(line[column]);
        sums[run->target] += sum;
    }
}

// Add a strip to the planes and empty it; `number` is that of its packets along x on the lens.
inline void finish_strip(const SensorPlanes *p, const Rays *rays, int number, const Strip *strip)
{
    const SensorPlaneArguments *n = p->numbers;
    const int u = strip->u;
    private uint4 line[PACKET_COLUMNS];
    for (int plane = 0; plane < n->planes; ++plane) {
        const int2 window = strip->window[plane];
        global const Runs *columns = runs_of(p, plane, rays->group_side, u, number);
        global const Run *run = columns->run, *end = run + columns->count;
        while (run < end && u + run->target < n->left) ++run;
        while (run < end && u + end[-1].target >= n->left + n->width) --end;
        for (int y = window.x; y < window.y; ++y) {
            global ulong4 *to = sums_of(p, plane) + (ulong)(y - n->top) * n->width;
            take_row(strip_row(p, strip, plane, y), line);
            add_columns(run, end, line, to + (u - n->left));
        }
        strip->window[plane] = (int2)(INT_MAX, 0);
    }
}
