// Encoder-ready frames: linear light to sRGB-encoded BT.709 YCbCr, limited range, rounded once.
#ifndef LFCORE_FRAMES_CL
#define LFCORE_FRAMES_CL
#include "bundle.cl"

// Where inner grids go in planar frames; CHROMA is 1 (4:4:4) or 2 (4:2:0, means of 2 x 2).
typedef struct {
    global const int4 *places;  // (E,) frame, x0, y0
    global uchar *frames;       // (F, 3 planes)
    int width, height;
} Frames;

// IEC 61966-2-1 encoding of values clamped to [0, 1].  A polynomial (least largest error, 7e-6) in the fourth
// root, of which two reciprocal square roots of the processor's give 13 bits: 0.04 of a code.
inline vf encode_srgb(vf x)
{
    x = clamp(x, (vf)(1.0e-9f), (vf)(1.0f));
    const vf root = native_rsqrt(native_rsqrt(x));
    vf p = -6.814727000e-02f;
    p = fma(p, root, (vf)(2.895329352e-01f));
    p = fma(p, root, (vf)(-5.774826995e-01f));
    p = fma(p, root, (vf)(1.255404424e+00f));
    p = fma(p, root, (vf)(1.620262543e-01f));
    p = fma(p, root, (vf)(-6.134021422e-02f));
    return pick(12.92f * x, p, GT(x, (vf)(0.0031308f)));
}

// Codes lie in [16, 240]; adding 1.5 * 2^23 rounds to the nearest, ties to even, into the low bits.
inline void store_bytes(global uchar *at, vf value, int count)
{
    const vu code = AS_VU(value + 12582912.0f) & 255u;
#if LANES == 1
    *at = NARROW(code);
#else
    const JOIN(uchar, LANES) bytes = NARROW(code);
    if (count >= LANES) VSTORE(bytes, at);
    else {
        private uchar each[LANES];
        VSTORE(bytes, each);
        for (int k = 0; k < count; ++k) at[k] = each[k];
    }
#endif
}

// Write a block of linear colours (3, BLOCK_RAYS), replaced by encoded chroma on the way, whose first
// ray is at column, row of its inner grid; columns and rows bound what is inside it.
inline void write_frames(const Frames *out, int element, int column, int row, int columns, int rows, global float *colours)
{
    const int4 place = out->places[element];
    const ulong pixels = (ulong)out->width * out->height, chroma = pixels / (CHROMA * CHROMA);
    global uchar *frame = out->frames + place.x * (pixels + 2 * chroma);
    const int x0 = place.y + column, y0 = place.z + row, chroma_width = out->width / CHROMA;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const int x = at % BLOCK, y = at / BLOCK;
        const vf r = encode_srgb(VLOAD(colours + at)), g = encode_srgb(VLOAD(colours + BLOCK_RAYS + at));
        const vf b = encode_srgb(VLOAD(colours + 2 * BLOCK_RAYS + at));
        const vf luma = fma(r, (vf)(0.2126f), fma(g, (vf)(0.7152f), b * 0.0722f));
        const vf cb = fma(b - luma, (vf)(224.0f / 1.8556f), (vf)(128.0f)), cr = fma(r - luma, (vf)(224.0f / 1.5748f), (vf)(128.0f));
        const int count = y < rows - row ? columns - column - x : 0;
        if (count > 0) store_bytes(frame + (ulong)(y0 + y) * out->width + x0 + x, fma(luma, (vf)(219.0f), (vf)(16.0f)), count);
#if CHROMA == 1
        if (count > 0) {
            store_bytes(frame + pixels + (ulong)(y0 + y) * chroma_width + x0 + x, cb, count);
            store_bytes(frame + 2 * pixels + (ulong)(y0 + y) * chroma_width + x0 + x, cr, count);
        }
#else
        VSTORE(cb, colours + at);
        VSTORE(cr, colours + BLOCK_RAYS + at);
#endif
    }
#if CHROMA == 2
    for (int y = 0; y < BLOCK && row + y < rows; y += 2)
        for (int x = 0; x < BLOCK && column + x < columns; x += 2)
            for (int plane = 0; plane < 2; ++plane) {
                // An odd inner grid repeats its last column and row.
                global const float *c = colours + plane * BLOCK_RAYS + y * BLOCK + x;
                const int right = column + x + 1 < columns ? 1 : 0, below = row + y + 1 < rows ? BLOCK : 0;
                const float mean = 0.25f * (c[0] + c[right] + c[below] + c[below + right]);
                frame[pixels + plane * chroma + (ulong)((y0 + y) / 2) * chroma_width + (x0 + x) / 2] = convert_uchar_sat_rte(mean);
            }
#endif
}

#endif
