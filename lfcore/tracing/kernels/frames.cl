// Encoder-ready frames: linear light to sRGB-encoded BT.709 YCbCr, limited range, rounded once; with RGB to
// planes of green, blue and red, full range.
#ifndef LFCORE_FRAMES_CL
#define LFCORE_FRAMES_CL
#include "series.cl"
#include "samples.cl"

// Where inner grids go in planar frames; CHROMA is 1 (4:4:4) or 2 (4:2:0, means of 2 x 2).
typedef struct {
    global const int4 *places;  // (E,) frame, x0, y0
    global sample *frames;      // (F, 3 planes)
    int width, height;
} Frames;

// IEC 61966-2-1 encoding of values clamped to [0, 1].  A polynomial (least largest error, 7e-6) in the fourth
// root, from two reciprocal square roots of the processor's, good to 11 bits or more, and one step of Newton's: the
// first is off by half as much in the root, 0.02 of a code of 8 bits in the mean and 0.07 at most: codes of more
// bits have it refined, too.
#define LINEAR_END 0.0031308f
inline vf encode_srgb(vf x)
{
    x = clamp(x, (vf)(1.0e-9f), (vf)(1.0f));
    const vf r = BITS == 8 ? native_rsqrt(x) : inverse_sqrt(x), y = native_rsqrt(r);
    const vf root = y * fma(-(y * r), y, (vf)(3.0f));  // twice that
    const vf square = root * root;
    const vf high = fma(root, (vf)(-6.814727000e-02f / 32.0f), (vf)(2.895329352e-01f / 16.0f));
    const vf middle = fma(root, (vf)(-5.774826995e-01f / 8.0f), (vf)(1.255404424e+00f / 4.0f));
    const vf low = fma(root, (vf)(1.620262543e-01f / 2.0f), (vf)(-6.134021422e-02f));
    const vf p = fma(fma(high, square, middle), square, low);
    return pick(12.92f * x, p, GT(x, (vf)(LINEAR_END)));
}

// Codes lie in [0, 2^BITS); in a sum with 1.5 * 2^23 they are rounded to the nearest, ties to even, into the low bits.
#define WHITE ((1 << BITS) - 1)
#define ROUNDED(code) ((vf)((code) + 12582912.0f))
inline void put_codes(vf sum, private sample *at) { VSTORE(NARROW(SAMPLE, AS_VU(sum) & (uint)WHITE), at); }

// Copy the `wide` x `high` codes of a block that are inside the inner grid.
inline void copy_codes(private const sample *codes, int wide, int high, global sample *to, int pitch)
{
    for (int y = 0; y < high; ++y, to += pitch, codes += BLOCK) {
        if (wide == BLOCK) vstore16(vload16(0, codes), 0, to);
        else for (int x = 0; x < wide; ++x) to[x] = codes[x];
    }
}

// sRGB over a block in each colour, where the brightest ray is at most RANGE times the darkest: a cubic through four
// Chebyshev nodes, off by 0.02 of a code of 8 bits at most, 0.01 of one of 10.
#define RANGE (BITS == 8 ? 2.0f : 1.5f)
typedef struct { float4 scale, shift, c[4]; } Encoding;  // of red, green and blue, and nothing

// False where colours vary more, are clamped or very dark.
inline int make_encoding(global const float *colours, Encoding *e)
{
    float low[4], high[4];
    for (int channel = 0; channel < 3; ++channel, colours += BLOCK_RAYS) {
        vf least = VLOAD(colours), most = least;
        for (int at = LANES; at < BLOCK_RAYS; at += LANES) {
            least = min(least, VLOAD(colours + at));
            most = max(most, VLOAD(colours + at));
        }
        low[channel] = row_min(least);
        high[channel] = row_max(most);
        if (!(low[channel] > LINEAR_END && high[channel] <= RANGE * low[channel] && high[channel] < 1.0f)) return 0;
    }
    low[3] = high[3] = 1.0f;
    const float4 from = vload4(0, low), to = vload4(0, high), middle = 0.5f * (from + to), half_width = max(0.5f * (to - from), 1.0e-6f);
    private float nodes[16];
    vstore4(middle + NODE_A * half_width, 0, nodes);
    vstore4(middle + NODE_B * half_width, 1, nodes);
    vstore4(middle - NODE_B * half_width, 2, nodes);
    vstore4(middle - NODE_A * half_width, 3, nodes);
    for (int at = 0; at < 16; at += LANES) VSTORE(encode_srgb(VLOAD(nodes + at)), nodes + at);
    float4 f[4];
    for (int k = 0; k < 4; ++k) f[k] = vload4(k, nodes);
    transform_nodes(f);
    e->scale = 1.0f / half_width;
    e->shift = -middle * e->scale;
    e->c[0] = f[0] - f[2];
    e->c[1] = f[1] - 3.0f * f[3];
    e->c[2] = 2.0f * f[2];
    e->c[3] = 4.0f * f[3];
    return 1;
}

#define CUBIC(e, x, channel)                                                                                                        \
    cubic(fma(x, (vf)((e).scale.channel), (vf)((e).shift.channel)), (e).c[0].channel, (e).c[1].channel, (e).c[2].channel, (e).c[3].channel)
inline vf cubic(vf t, float a, float b, float c, float d) { return fma(fma(fma((vf)(d), t, (vf)(c)), t, (vf)(b)), t, (vf)(a)); }

// Codes of encoded colours, those of ray `at` and on; chroma that is averaged takes the colours' place.
inline void put_colours(vf r, vf g, vf b, int at, private sample *codes, global float *colours)
{
#if RGB
    put_codes(fma(g, (vf)(WHITE), ROUNDED(0.0f)), codes + at);
    put_codes(fma(b, (vf)(WHITE), ROUNDED(0.0f)), codes + BLOCK_RAYS + at);
    put_codes(fma(r, (vf)(WHITE), ROUNDED(0.0f)), codes + 2 * BLOCK_RAYS + at);
#else
    const vf luma = fma(r, (vf)(0.2126f), fma(g, (vf)(0.7152f), b * 0.0722f));
    const vf blue = b - luma, red = r - luma;
    put_codes(fma(luma, (vf)(219.0f * CODES), ROUNDED(16.0f * CODES)), codes + at);
#if CHROMA == 1
    put_codes(fma(blue, (vf)(224.0f / 1.8556f * CODES), ROUNDED(128.0f * CODES)), codes + BLOCK_RAYS + at);
    put_codes(fma(red, (vf)(224.0f / 1.5748f * CODES), ROUNDED(128.0f * CODES)), codes + 2 * BLOCK_RAYS + at);
#else
    VSTORE(fma(blue, (vf)(224.0f / 1.8556f * CODES), (vf)(128.0f * CODES)), colours + at);
    VSTORE(fma(red, (vf)(224.0f / 1.5748f * CODES), (vf)(128.0f * CODES)), colours + BLOCK_RAYS + at);
#endif
#endif
}

// Write a block of linear colours (3, BLOCK_RAYS), replaced by encoded chroma on the way if that is averaged, whose
// first ray is at column, row of its inner grid; columns and rows bound what is inside it.
inline void write_frames(const Frames *out, int element, int column, int row, int columns, int rows, global float *colours)
{
    private sample codes[3 * BLOCK_RAYS];  // written out when all are made: loops without branches keep their constants
    global const float *green = colours + BLOCK_RAYS, *blue = colours + 2 * BLOCK_RAYS;
    const int wide = min(BLOCK, columns - column), high = min(BLOCK, rows - row);
    Encoding e;
    if (wide == BLOCK && high == BLOCK && make_encoding(colours, &e))
        for (int at = 0; at < BLOCK_RAYS; at += LANES)
            put_colours(CUBIC(e, VLOAD(colours + at), x), CUBIC(e, VLOAD(green + at), y), CUBIC(e, VLOAD(blue + at), z), at, codes, colours);
    else
        for (int at = 0; at < BLOCK_RAYS; at += LANES)
            put_colours(encode_srgb(VLOAD(colours + at)), encode_srgb(VLOAD(green + at)), encode_srgb(VLOAD(blue + at)), at, codes, colours);
    const int4 place = out->places[element];
    const ulong pixels = (ulong)out->width * out->height, chroma = pixels / (CHROMA * CHROMA);
    global sample *frame = out->frames + place.x * (pixels + 2 * chroma);
    const int x0 = place.y + column, y0 = place.z + row;
    for (int plane = 0; plane < (CHROMA == 1 ? 3 : 1); ++plane)
        copy_codes(codes + plane * BLOCK_RAYS, wide, high, frame + plane * pixels + (ulong)y0 * out->width + x0, out->width);
#if CHROMA == 2
    for (int y = 0; y < BLOCK && row + y < rows; y += 2)
        for (int x = 0; x < BLOCK && column + x < columns; x += 2)
            for (int plane = 0; plane < 2; ++plane) {
                // An odd inner grid repeats its last column and row.
                global const float *c = colours + plane * BLOCK_RAYS + y * BLOCK + x;
                const int right = column + x + 1 < columns ? 1 : 0, below = row + y + 1 < rows ? BLOCK : 0;
                const float mean = 0.25f * (c[0] + c[right] + c[below] + c[below + right]);
                const ulong at = (ulong)((y0 + y) / 2) * (out->width / 2) + (x0 + x) / 2;
                frame[pixels + plane * chroma + at] = JOIN(JOIN(convert_, SAMPLE), _sat_rte)(mean);
            }
#endif
}

#endif
