// What is made of a packet's colours: sensor planes, and encoder-ready frames.
//
// Frames are BT.709 YCbCr, limited range, rounded once, or RGB channels of green, blue and red,
// full range; sRGB-encoded, or PQ where PEAK, the linear light of the brightest code, is not 0.
#pragma once
#include "block.cl"
#include "packet_sums.cl"
#include "powers.cl"

// IEC 61966-2-1 encoding of values clamped to [0, 1]: a polynomial (least largest error, 7e-6) in
// the fourth root.
#define LINEAR_END 0.0031308f
// As good as black: 12.92 times it is three millionths of a code of 8 bits.  Roots of less would be
// those of denormal numbers.
#define BLACK 1.0e-9f
inline vf encode_srgb(vf x)
{
    x = clamp(x, (vf)(BLACK), (vf)(1.0f));
    const vf square = sqrt(x), root = sqrt(square);
    const vf high = fma(root, (vf)(-6.814727000e-02f), (vf)(2.895329352e-01f));
    const vf middle = fma(root, (vf)(-5.774826995e-01f), (vf)(1.255404424e+00f));
    const vf low = fma(root, (vf)(1.620262543e-01f), (vf)(-6.134021422e-02f));
    const vf p = fma(fma(high, square, middle), square, low);
    return pick(12.92f * x, p, GT(x, (vf)(LINEAR_END)));
}

// Chebyshev nodes of the third degree: cos(pi / 8) and cos(3 pi / 8).
#define NODE_A 0.9238795325f
#define NODE_B 0.3826834324f

// The encoding over a block in each colour, where the brightest ray is at most RANGE times the
// darkest: a cubic through four Chebyshev nodes, off by 0.02 of a code of 8 bits at most, 0.01 of
// one of 10, 0.03 of one of 12. Source: L. N. Trefethen, "Approximation Theory and Approximation
// Practice", 2013, chapter 3.
#define RANGE (BITS == 8 ? 2.0f : 1.5f)
// Narrower than this share of the middle coefficients would cancel.
#define NARROWEST 0.05f
typedef struct { float4 c[4]; } CubicEncoding;  // coefficients of red, green and blue, and nothing

// False where colours vary more than RANGE, are clamped or very dark.
inline int make_cubic(global const float *colours, CubicEncoding *e)
{
    Ranges ranges;
    clear_ranges(&ranges);
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        add_to_ranges(&ranges, load3(colours, at), (vi)(-1));
    const Box box = box_of(&ranges);
    const float4 from = (float4)(vload3(0, box.lo), 1.0f), to = (float4)(vload3(0, box.hi), 1.0f);
    if (PEAK > 0 || !all(from.xyz > LINEAR_END && to.xyz <= RANGE * from.xyz && to.xyz < 1.0f))
        return 0;
    const float4 middle = 0.5f * (from + to);
    const float4 half_width = max(0.5f * (to - from), NARROWEST * middle);
    private float nodes[16];
    const float node[4] = {NODE_A, NODE_B, -NODE_B, -NODE_A};
    for (int k = 0; k < 4; ++k) vstore4(middle + node[k] * half_width, k, nodes);
    for (int at = 0; at < 16; at += LANES) VSTORE(encode_srgb(VLOAD(nodes + at)), nodes + at);
    const float4 n0 = vload4(0, nodes), n1 = vload4(1, nodes), n2 = vload4(2, nodes);
    const float4 n3 = vload4(3, nodes), outer = n0 - n3, inner = n1 - n2;
    const float4 f0 = 0.25f * ((n0 + n3) + (n1 + n2));
    const float4 f1 = 0.5f * (NODE_A * outer + NODE_B * inner);
    const float4 f2 = 0.3535533906f * ((n0 + n3) - (n1 + n2));
    const float4 f3 = 0.5f * (NODE_B * outer - NODE_A * inner);
    // The same in place of (colour - middle) / half_width in the colour itself.
    const float4 scale = 1.0f / half_width, shift = -middle * scale;
    const float4 b = f1 - 3.0f * f3, c = 2.0f * f2, d = 4.0f * f3;
    e->c[0] = f0 - f2 + shift * (b + shift * (c + shift * d));
    e->c[1] = scale * (b + shift * (2.0f * c + shift * (3.0f * d)));
    e->c[2] = scale * scale * (c + shift * (3.0f * d));
    e->c[3] = scale * scale * scale * d;
    return 1;
}

// A row of colours encoded, by a cubic if there is one.
inline Vec encode_row(Vec c, const CubicEncoding *e)
{
    const float scale = 1.0f / (float)(PEAK);
    if (PEAK > 0) return (Vec){encode_pq(c.x, scale), encode_pq(c.y, scale), encode_pq(c.z, scale)};
    if (!e) return (Vec){encode_srgb(c.x), encode_srgb(c.y), encode_srgb(c.z)};
    Vec sum = spread3(e->c[3].xyz);
    for (int k = 2; k >= 0; --k)
        sum = (Vec){fma(sum.x, c.x, (vf)(e->c[k].x)), fma(sum.y, c.y, (vf)(e->c[k].y)),
                    fma(sum.z, c.z, (vf)(e->c[k].z))};
    return sum;
}

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

// Such sums of three channels of LANES encoded colours.  Chroma that is to be averaged is not
// rounded.
inline Vec codes_of(Vec c, const FrameArguments *n)
{
    if (n->rgb) return fma3((vf)(WHITE), (Vec){c.y, c.z, c.x}, spread3(ROUNDER));
    const vf luma = fma(c.x, (vf)(0.2126f), fma(c.y, (vf)(0.7152f), c.z * 0.0722f));
    const vf grey = 128.0f * CODES + (n->chroma > 1 ? 0.0f : ROUNDER);
    return (Vec){fma(luma, (vf)(219.0f * CODES), (vf)(16.0f * CODES + ROUNDER)),
                 fma(c.z - luma, (vf)(224.0f / 1.8556f * CODES), grey),
                 fma(c.x - luma, (vf)(224.0f / 1.5748f * CODES), grey)};
}

// Write `wide` columns and `high` rows of a block to a frame, encoded by a cubic if there is one.
// Codes replace the colours in memory.
inline void write_rows(const CubicEncoding *e, const FrameArguments *n, int wide, int high,
                       global float *colours, global sample *to)
{
    const ulong pixels = (ulong)n->width * n->height;
    for (int y = 0; y < high; ++y, colours += BLOCK, to += n->width) {
        for (int at = 0; at < BLOCK; at += LANES)
            store3(codes_of(encode_row(load3(colours, at), e), n), colours, at);
        for (int channel = 0; channel < (n->chroma > 1 ? 1 : 3); ++channel)
            store_codes(as_uint16(vload16(0, colours + channel * BLOCK_RAYS)), wide,
                        to + channel * pixels);
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
        average_chroma(colours + (1 + channel) * BLOCK_RAYS, inside.x, inside.y,
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
} Cells;

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

// Hand on the cells of a packet that was coloured.
inline void finish_packet(const Packet *packet, Cells *c)
{
    global const Slot *slot = c->frames.slots + first_element(packet);
    const int group = packet->rays->group;
    c->strip.u = slot->column / group * group;
    const int v = slot->row / group * group;
    if (PLANES == 1) add_to_strip(&c->planes, packet, v, c->colours, c->prefix, &c->strip);
    write_cells(c, packet);
}
