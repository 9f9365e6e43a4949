// Encoder-ready frames: BT.709 YCbCr, limited range, rounded once, or RGB channels of green, blue
// and red, full range; sRGB-encoded, or PQ where the format has a peak.
#pragma once
#include "blocks.cl"
#include "pq.cl"
#include "samples.cl"

// IEC 61966-2-1 encoding of values clamped to [0, 1]: a polynomial (least largest error, 7e-6) in
// the fourth root.
#define LINEAR_END 0.0031308f
#define BLACK 1.0e-9f  // far below a code; roots of less would be denormal
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

// A row of colours encoded.
inline Vec encode_row(const FrameFormat *n, Vec c)
{
    const float scale = 1.0f / n->peak;
    if (n->peak > 0.0f) return (Vec){encode_pq(c.x, scale), encode_pq(c.y, scale), encode_pq(c.z, scale)};
    return (Vec){encode_srgb(c.x), encode_srgb(c.y), encode_srgb(c.z)};
}

// Planar frames, and where each element's inner grid goes in them.
typedef struct {
    global const Placement *placements;  // (E,)
    global sample *frames;               // (F, 3 channels)
    const FrameFormat *format;
} Frames;

// Codes lie in [0, 2^BITS); a sum with ROUNDER rounds them to the nearest even into the low bits.
#define WHITE ((1 << BITS) - 1)
#define ROUNDER 12582912.0f  // 1.5 * 2^23

// Write the first `columns` codes of such sums.
inline void store_codes(uint16 sums, int columns, global sample *to)
{
    const SAMPLES(16) codes = JOIN(convert_, SAMPLES(16))(sums & (uint)WHITE);
    if (columns == BLOCK) {
        vstore16(codes, 0, to);
    } else if (columns == BLOCK / 2) {
        vstore8(codes.lo, 0, to);
    } else {
        private sample row[BLOCK];
        vstore16(codes, 0, row);
        for (int k = 0; k < columns; ++k) to[k] = row[k];
    }
}

// Such sums of three channels of encoded colours.  Chroma that is to be averaged is not rounded.
inline Vec codes_of(Vec c, const FrameFormat *n)
{
    if (n->rgb) return fma3((vf)(WHITE), (Vec){c.y, c.z, c.x}, spread3(ROUNDER));
    const vf luma = fma(c.x, (vf)(0.2126f), fma(c.y, (vf)(0.7152f), c.z * 0.0722f));
    const vf grey = 128.0f * CODES + (n->subsampling > 1 ? 0.0f : ROUNDER);
    return (Vec){fma(luma, (vf)(219.0f * CODES), (vf)(16.0f * CODES + ROUNDER)),
                 fma(c.z - luma, (vf)(224.0f / 1.8556f * CODES), grey),
                 fma(c.x - luma, (vf)(224.0f / 1.5748f * CODES), grey)};
}

// Write columns and rows of a block to a frame.  Codes replace the colours in memory.
inline void write_rows(const FrameFormat *n, int columns, int rows, global float *colours,
                       global sample *to)
{
    const ulong pixels = (ulong)n->width * n->height;
    for (int y = 0; y < rows; ++y, colours += BLOCK, to += n->width) {
        for (int at = 0; at < BLOCK; at += LANES)
            store3(codes_of(encode_row(n, load3(colours, at)), n), colours, at);
        for (int channel = 0; channel < (n->subsampling > 1 ? 1 : 3); ++channel)
            store_codes(as_uint16(vload16(0, colours + channel * BLOCK_RAYS)), columns,
                        to + channel * pixels);
    }
}

// Average chroma over 2 x 2 rays; an odd inner grid repeats its last column and row.
inline void average_chroma(global float *chroma, int2 inside, global sample *to, int pitch)
{
    for (int y = 0; y < inside.y; y += 2, to += pitch) {
        global float *above = chroma + y * BLOCK, *below = y + 1 < inside.y ? above + BLOCK : above;
        if (inside.x & 1) {
            above[inside.x] = above[inside.x - 1];
            below[inside.x] = below[inside.x - 1];
        }
        const float16 a = vload16(0, above), b = vload16(0, below);
        const uint8 sums = as_uint8(fma(a.even + a.odd + b.even + b.odd, 0.25f, ROUNDER));
        store_codes((uint16)(sums, sums), (inside.x + 1) / 2, to);
    }
}

// Write a block of linear colours (3, BLOCK_RAYS), and overwrite them.  Its first ray is at `at` of
// the inner grid, in which `inside` columns and rows lie.
inline void write_frames(const Frames *out, int element, int2 at, int2 inside,
                         global float *colours)
{
    const FrameFormat *n = out->format;
    global const Placement *placed = out->placements + element;
    const int step = n->subsampling, pitch = n->width / 2;
    const ulong pixels = (ulong)n->width * n->height, chroma = pixels / (step * step);
    global sample *frame = out->frames + placed->frame * (pixels + 2 * chroma);
    const int x0 = placed->x + at.x, y0 = placed->y + at.y;
    global sample *to = frame + (ulong)y0 * n->width + x0;
    write_rows(n, inside.x, inside.y, colours, to);
    if (step == 1) return;
    for (int channel = 0; channel < 2; ++channel)
        average_chroma(colours + (1 + channel) * BLOCK_RAYS, inside,
                       frame + pixels + channel * chroma + (ulong)(y0 / 2) * pitch + x0 / 2, pitch);
}
