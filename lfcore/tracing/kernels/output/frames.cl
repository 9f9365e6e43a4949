// What is made of a packet's colours: sensor planes, and encoder-ready frames.
//
// Frames are sRGB- or PQ-encoded BT.709 YCbCr, limited range, rounded once; with RGB channels of
// green, blue and red, full range.
#pragma once
#include "packet_sums.cl"
#include "srgb.cl"

// Where inner grids go in planar frames.
typedef struct {
    global const Slot *slots;  // (E,)
    global sample *frames;     // (F, 3 channels)
    const FrameArguments *numbers;
} Frames;

// Codes lie in [0, 2^BITS); in a sum with ROUNDER they are rounded to the nearest, ties to even,
// into the low bits.
#define WHITE ((1 << BITS) - 1)
#define ROUNDER 12582912.0f  // 1.5 * 2^23
#define ROUNDED(code) ((vf)((code) + ROUNDER))

// Write the first `wide` codes of such sums.
inline void store_codes(uint16 sums, int wide, global sample *to)
{
    const SAMPLES(16) codes = JOIN(convert_, SAMPLES(16))(sums & (uint)WHITE);
    if (wide == BLOCK) {
        vstore16(codes, 0, to);
    } else if (wide == BLOCK / 2) {
        vstore8(codes.lo, 0, to);
    } else {
        private sample row[BLOCK];
        vstore16(codes, 0, row);
        for (int k = 0; k < wide; ++k) to[k] = row[k];
    }
}

// Encode LANES colours as such sums of three channels.  Chroma that is to be averaged replaces the
// colours in memory.
inline Vec encode_part(Vec c, const FrameArguments *n, global float *chroma)
{
    if (n->rgb) {
        return (Vec){fma(c.y, (vf)(WHITE), ROUNDED(0.0f)),
                     fma(c.z, (vf)(WHITE), ROUNDED(0.0f)),
                     fma(c.x, (vf)(WHITE), ROUNDED(0.0f))};
    }
    const vf luma = fma(c.x, (vf)(0.2126f), fma(c.y, (vf)(0.7152f), c.z * 0.0722f));
    const vf blue = c.z - luma, red = c.x - luma;
    const vf to_blue = 224.0f / 1.8556f * CODES, to_red = 224.0f / 1.5748f * CODES;
    if (n->chroma > 1) {
        VSTORE(fma(blue, to_blue, (vf)(128.0f * CODES)), chroma);
        VSTORE(fma(red, to_red, (vf)(128.0f * CODES)), chroma + BLOCK_RAYS);
    }
    return (Vec){fma(luma, (vf)(219.0f * CODES), ROUNDED(16.0f * CODES)),
                 fma(blue, to_blue, ROUNDED(128.0f * CODES)),
                 fma(red, to_red, ROUNDED(128.0f * CODES))};
}

// Write `wide` columns and `high` rows of a block to a frame, encoded by a cubic if there is one.
inline void write_rows(const CubicEncoding *e, const FrameArguments *n, int wide, int high,
                       global float *colours, global sample *to)
{
    const ulong pixels = (ulong)n->width * n->height;
    for (int y = 0; y < high; ++y, colours += BLOCK, to += n->width) {
        private float sums[3][BLOCK];
        for (int at = 0; at < BLOCK; at += LANES) {
            const Vec part = encode_part(encode_row(load3(colours, at), e), n, colours + at);
            VSTORE(part.x, sums[0] + at);
            VSTORE(part.y, sums[1] + at);
            VSTORE(part.z, sums[2] + at);
        }
        for (int channel = 0; channel < 3; ++channel)
            if (!channel || n->chroma == 1)
                store_codes(as_uint16(vload16(0, sums[channel])), wide, to + channel * pixels);
    }
}

// Average chroma over 2 x 2 rays; an odd inner grid repeats its last column and row.
inline void average_chroma(global float *chroma, int wide, int high, global sample *to, int pitch)
{
    for (int y = 0; y < high; y += 2, to += pitch) {
        global float *above = chroma + y * BLOCK, *below = y + 1 < high ? above + BLOCK : above;
        if (wide & 1) {
            above[wide] = above[wide - 1];
            below[wide] = below[wide - 1];
        }
        const float16 a = vload16(0, above), b = vload16(0, below);
        const uint8 sums = as_uint8(fma(a.even + a.odd + b.even + b.odd, 0.25f, ROUNDER));
        store_codes((uint16)(sums, sums), (wide + 1) / 2, to);
    }
}

// Write a cell of linear colours (3, BLOCK_RAYS), which this changes.  Its first ray is at `at` of
// its inner grid, and `inside` columns and rows lie within that.
inline void write_frames(const Frames *out, int element, int2 at, int2 inside,
                         global float *colours)
{
    const FrameArguments *n = out->numbers;
    global const Slot *slot = out->slots + element;
    const ulong pixels = (ulong)n->width * n->height, chroma = pixels / (n->chroma * n->chroma);
    global sample *frame = out->frames + slot->frame * (pixels + 2 * chroma);
    const int x0 = slot->x + at.x, y0 = slot->y + at.y;
    global sample *to = frame + (ulong)y0 * n->width + x0;
    CubicEncoding e;
    if (all(inside == BLOCK) && make_cubic(colours, &e))
        write_rows(&e, n, BLOCK, BLOCK, colours, to);
    else write_rows(0, n, inside.x, inside.y, colours, to);
    if (n->chroma == 1) return;
    const int pitch = n->width / 2;
    for (int channel = 0; channel < 2; ++channel)
        average_chroma(colours + channel * BLOCK_RAYS, inside.x, inside.y,
                       frame + pixels + channel * chroma + (ulong)(y0 / 2) * pitch + x0 / 2, pitch);
}

// Cells: the colours of a packet, 16 x 16 inner rays of one element at a time.
#define BRIGHTEST ((float)(1 << STOPS))  // that is stored
#define COLOURS (3 * BLOCK_RAYS)         // of one cell
typedef struct {
    global float *colours;     // (cells, 3, BLOCK_RAYS), and of one block of several elements
    global ColourRow *prefix;  // (PACKET_COLUMNS + 1,)
    Frames frames;
    SensorPlanes planes;
    Strip strip;
    int u;                     // first column of the strip's pixels
} Cells;

// Where the colours of a block of a packet are made.
inline global float *block_colours(const Cells *c, const Packet *packet, int block)
{
    return c->colours + (OUTER > 1 ? packet->rays->cells : block) * COLOURS;
}

// Clamp a block's colours to what is stored; those of several elements are put into their cells.
inline void clamp_colours(const Cells *c, const Packet *packet, int block, global float *colours)
{
    if (OUTER == 1) {
        for (int at = 0; at < COLOURS; at += LANES)
            VSTORE(clamp(VLOAD(colours + at), (vf)(0.0f), (vf)(BRIGHTEST)), colours + at);
        return;
    }
    const int2 first = packet->rays->block[block].at;
    const int side = packet->rays->packet_side / BLOCK;
    const int within = first.y / BLOCK * side + first.x / BLOCK;
    const int corner = first.y % BLOCK * BLOCK + first.x % BLOCK;
    for (int at = 0; at < BLOCK_RAYS; at += 4) {
        const int element = at / BLOCK / INNER * OUTER + at % BLOCK / INNER;
        const int ray = corner + at / BLOCK % INNER * BLOCK + at % INNER;
        global float *to = c->colours + (element * side * side + within) * COLOURS + ray;
        for (int channel = 0; channel < 3; ++channel) {
            const float4 colour = vload4(0, colours + channel * BLOCK_RAYS + at);
            vstore4(clamp(colour, 0.0f, BRIGHTEST), 0, to + channel * BLOCK_RAYS);
        }
    }
}

// Write the cells of a packet: planes of views, and frames, in which the cells end.
inline void write_cells(const Cells *c, const Packet *packet)
{
    const int2 grid = (int2)(packet->rays->columns, packet->rays->rows);
    for (int cell = 0; cell < packet->rays->cells; ++cell) {
        const int element = cell_element(packet, cell);
        if (element < 0) continue;
        const int2 where = cell_position(packet, cell);
        global const Slot *slot = c->frames.slots + element;
        global float *colours = c->colours + cell * COLOURS;
        if (PLANES == 2) add_view(&c->planes, (int2)(slot->column, slot->row), where, colours);
        if (BITS) write_frames(&c->frames, element, where, min(grid - where, BLOCK), colours);
    }
}

// Hand on the cells of a packet that was coloured, and its strip after the last packet.
inline void finish_packet(const Packet *packet, const PacketQueue *queue, Cells *c)
{
    const Rays *rays = packet->rays;
    if (packet->blocks) {
        global const Slot *slot = c->frames.slots + first_element(packet);
        c->u = slot->column / rays->group * rays->group;
        const int v = slot->row / rays->group * rays->group;
        if (PLANES == 1) add_to_strip(&c->planes, packet, v, c->colours, c->prefix, &c->strip);
        write_cells(c, packet);
    }
    if (PLANES == 1 && queue->step == queue->height - 1)
        finish_strip(&c->planes, rays, c->u, queue->strip % rays->packets_in_x, &c->strip);
}
