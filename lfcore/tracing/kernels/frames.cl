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

// IEC 61966-2-1 encoding of values clamped to [0, 1]: a polynomial (least largest error, 7e-6) in the fourth root.
#define LINEAR_END 0.0031308f
inline vf encode_srgb(vf x)
{
    x = clamp(x, (vf)(1.0e-9f), (vf)(1.0f));
    const vf square = sqrt(x), root = sqrt(square);
    const vf high = fma(root, (vf)(-6.814727000e-02f), (vf)(2.895329352e-01f));
    const vf middle = fma(root, (vf)(-5.774826995e-01f), (vf)(1.255404424e+00f));
    const vf low = fma(root, (vf)(1.620262543e-01f), (vf)(-6.134021422e-02f));
    const vf p = fma(fma(high, square, middle), square, low);
    return pick(12.92f * x, p, GT(x, (vf)(LINEAR_END)));
}

// Codes lie in [0, 2^BITS); in a sum with 1.5 * 2^23 they are rounded to the nearest, ties to even, into the low bits.
#define WHITE ((1 << BITS) - 1)
#define ROUNDED(code) ((vf)((code) + 12582912.0f))
#define ROW_PARTS (BLOCK / LANES)
#if LANES == 16
#define WHOLE_ROW(part) AS_VU((part)[0])
#elif LANES == 8
#define WHOLE_ROW(part) ((uint16)(AS_VU((part)[0]), AS_VU((part)[1])))
#elif LANES == 4
#define WHOLE_ROW(part) ((uint16)(AS_VU((part)[0]), AS_VU((part)[1]), AS_VU((part)[2]), AS_VU((part)[3])))
#endif

// Write the first `wide` codes of a block's row from such sums: all 16 are packed at once.
inline void put_codes(private const vf *sums, int wide, global sample *to)
{
#if LANES == 1
    for (int k = 0; k < wide; ++k) to[k] = NARROW(SAMPLE, AS_VU(sums[k]) & (uint)WHITE);
#else
    const SAMPLES(16) codes = JOIN(convert_, SAMPLES(16))(WHOLE_ROW(sums) & (uint)WHITE);
    if (wide == BLOCK) {
        vstore16(codes, 0, to);
        return;
    }
    private sample row[BLOCK];
    vstore16(codes, 0, row);
    for (int k = 0; k < wide; ++k) to[k] = row[k];
#endif
}

// sRGB over a block in each colour, where the brightest ray is at most RANGE times the darkest: a cubic through four
// Chebyshev nodes, off by 0.02 of a code of 8 bits at most, 0.01 of one of 10.
#define RANGE (BITS == 8 ? 2.0f : 1.5f)
// Narrower than this share of the middle coefficients would cancel.
#define NARROWEST 0.05f
typedef struct { float4 c[4]; } Encoding;  // coefficients of red, green and blue, and nothing

// False where colours vary more, are clamped or very dark.
inline int make_encoding(global const float *colours, Encoding *e)
{
    float low[4], high[4];
    vf least[3], most[3];
    for (int k = 0; k < 3; ++k) least[k] = most[k] = VLOAD(colours + k * BLOCK_RAYS);
    for (int at = 0; at < BLOCK_RAYS; at += BLOCK)
        for (int k = 0; k < 3 * ROW_PARTS; ++k) {
            const vf x = VLOAD(colours + k % 3 * BLOCK_RAYS + at + k / 3 * LANES);
            least[k % 3] = min(least[k % 3], x);
            most[k % 3] = max(most[k % 3], x);
        }
    for (int k = 0; k < 3; ++k) {
        low[k] = row_min(least[k]);
        high[k] = row_max(most[k]);
        if (!(low[k] > LINEAR_END && high[k] <= RANGE * low[k] && high[k] < 1.0f)) return 0;
    }
    low[3] = high[3] = 1.0f;
    const float4 from = vload4(0, low), to = vload4(0, high), middle = 0.5f * (from + to);
    const float4 half_width = max(0.5f * (to - from), NARROWEST * middle);
    private float nodes[16];
    vstore4(middle + NODE_A * half_width, 0, nodes);
    vstore4(middle + NODE_B * half_width, 1, nodes);
    vstore4(middle - NODE_B * half_width, 2, nodes);
    vstore4(middle - NODE_A * half_width, 3, nodes);
    for (int at = 0; at < 16; at += LANES) VSTORE(encode_srgb(VLOAD(nodes + at)), nodes + at);
    float4 f[4];
    for (int k = 0; k < 4; ++k) f[k] = vload4(k, nodes);
    transform_nodes(f);
    // The same in place of (colour - middle) / half_width in the colour itself.
    const float4 scale = 1.0f / half_width, shift = -middle * scale;
    const float4 b = f[1] - 3.0f * f[3], c = 2.0f * f[2], d = 4.0f * f[3];
    e->c[0] = f[0] - f[2] + shift * (b + shift * (c + shift * d));
    e->c[1] = scale * (b + shift * (2.0f * c + shift * (3.0f * d)));
    e->c[2] = scale * scale * (c + shift * (3.0f * d));
    e->c[3] = scale * scale * scale * d;
    return 1;
}

inline vf cubic(vf t, float a, float b, float c, float d) { return fma(fma(fma((vf)(d), t, (vf)(c)), t, (vf)(b)), t, (vf)(a)); }

// A row of a block's colours, encoded.
typedef struct { vf r[ROW_PARTS], g[ROW_PARTS], b[ROW_PARTS]; } EncodedRow;

inline void encode_row(global const float *colours, EncodedRow *row)
{
    for (int k = 0; k < ROW_PARTS; ++k, colours += LANES) {
        row->r[k] = encode_srgb(VLOAD(colours));
        row->g[k] = encode_srgb(VLOAD(colours + BLOCK_RAYS));
        row->b[k] = encode_srgb(VLOAD(colours + 2 * BLOCK_RAYS));
    }
}

inline void encode_evenly(const Encoding *e, global const float *colours, EncodedRow *row)
{
    for (int k = 0; k < ROW_PARTS; ++k, colours += LANES) {
        const vf r = VLOAD(colours), g = VLOAD(colours + BLOCK_RAYS), b = VLOAD(colours + 2 * BLOCK_RAYS);
        row->r[k] = cubic(r, e->c[0].x, e->c[1].x, e->c[2].x, e->c[3].x);
        row->g[k] = cubic(g, e->c[0].y, e->c[1].y, e->c[2].y, e->c[3].y);
        row->b[k] = cubic(b, e->c[0].z, e->c[1].z, e->c[2].z, e->c[3].z);
    }
}

// Write the first `wide` codes of that row into planes `pitch` samples apart; chroma that is averaged takes the place of
// the row's colours.
inline void put_colours(const EncodedRow *row, int wide, global sample *to, ulong pitch, global float *colours)
{
    vf first[ROW_PARTS], second[ROW_PARTS], third[ROW_PARTS];
    for (int k = 0; k < ROW_PARTS; ++k) {
        const vf r = row->r[k], g = row->g[k], b = row->b[k];
#if RGB
        first[k] = fma(g, (vf)(WHITE), ROUNDED(0.0f));
        second[k] = fma(b, (vf)(WHITE), ROUNDED(0.0f));
        third[k] = fma(r, (vf)(WHITE), ROUNDED(0.0f));
#else
        const vf luma = fma(r, (vf)(0.2126f), fma(g, (vf)(0.7152f), b * 0.0722f));
        const vf blue = b - luma, red = r - luma;
        first[k] = fma(luma, (vf)(219.0f * CODES), ROUNDED(16.0f * CODES));
#if CHROMA == 1
        second[k] = fma(blue, (vf)(224.0f / 1.8556f * CODES), ROUNDED(128.0f * CODES));
        third[k] = fma(red, (vf)(224.0f / 1.5748f * CODES), ROUNDED(128.0f * CODES));
#else
        VSTORE(fma(blue, (vf)(224.0f / 1.8556f * CODES), (vf)(128.0f * CODES)), colours + k * LANES);
        VSTORE(fma(red, (vf)(224.0f / 1.5748f * CODES), (vf)(128.0f * CODES)), colours + BLOCK_RAYS + k * LANES);
#endif
#endif
    }
    put_codes(first, wide, to);
#if CHROMA == 1
    put_codes(second, wide, to + pitch);
    put_codes(third, wide, to + 2 * pitch);
#endif
}

// Write `wide` columns and `high` rows of a block to a frame, by an encoding of all its colours if there is one.
inline void write_rows(const Encoding *e, int wide, int high, global float *colours, global sample *to, ulong width, ulong pixels)
{
    for (int y = 0; y < high; ++y, colours += BLOCK, to += width) {
        EncodedRow encoded;
        if (e) encode_evenly(e, colours, &encoded);
        else encode_row(colours, &encoded);
        put_colours(&encoded, wide, to, pixels, colours);
    }
}

// Write a block of linear colours (3, BLOCK_RAYS), replaced by encoded chroma on the way if that is averaged, whose
// first ray is at column, row of its inner grid; columns and rows bound what is inside it.
inline void write_frames(const Frames *out, int element, int column, int row, int columns, int rows, global float *colours)
{
    const int wide = min(BLOCK, columns - column), high = min(BLOCK, rows - row);
    const int4 place = out->places[element];
    const ulong pixels = (ulong)out->width * out->height, chroma = pixels / (CHROMA * CHROMA);
    global sample *frame = out->frames + place.x * (pixels + 2 * chroma);
    const int x0 = place.y + column, y0 = place.z + row;
    global sample *to = frame + (ulong)y0 * out->width + x0;
    Encoding e;
    if (wide < BLOCK || high < BLOCK) write_rows(0, wide, high, colours, to, out->width, pixels);
    else if (make_encoding(colours, &e)) write_rows(&e, BLOCK, BLOCK, colours, to, out->width, pixels);
    else write_rows(0, BLOCK, BLOCK, colours, to, out->width, pixels);
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
