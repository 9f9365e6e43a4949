// The sums of a strip of a picture, in layers by sweep.
//
// Light is in fixed point, so sums do not depend on the order of rays, the number of threads or the
// parts in which rays are added.  Each work-item owns a strip of rows of one plane; no two
// work-items write to the same address.
//
// Narrow layers hold the light of each pixel.  Wide layers hold the differences of such sums along
// both axes: there a box is 16 numbers, whatever its size (the inverse of F. Crow, "Summed-area
// tables for texture mapping", SIGGRAPH 1984).  HALVED: the widest layers have pixels of twice the
// picture's width, a quarter of the memory, and light is interpolated between them.
#pragma once
#include "kernel.cl"

#define KERNEL KERNEL_OF(float16)
#define LAYERS (2 * N_BOUNDS + 1)
#define NARROW_LAYERS (N_BOUNDS < 2 ? N_BOUNDS - 1 : 1)  // before and behind the middle layer
// LENS: aberrations make large boxes in narrow layers, too.  Each of these has another layer, of
// differences, behind all others; FIRST_NARROW is the number of the first.
#define FIRST_NARROW (N_BOUNDS - NARROW_LAYERS)
#define LARGE_LAYERS (LENS && N_BOUNDS ? 2 * NARROW_LAYERS + 1 : 0)
#define ALL_LAYERS (LAYERS + LARGE_LAYERS)
#define LARGE_OF(layer) ((layer) - FIRST_NARROW + LAYERS)
// Whether a layer, or which of sixteen, are more than n layers from the middle one: OpenCL compares
// numbers to 1 or 0, and vectors to masks of -1 or 0.
#define ARE_BEYOND(layers, n) ((layers) < N_BOUNDS - (n) | (layers) > N_BOUNDS + (n))
inline int is_wide(int layer) { return ARE_BEYOND(layer, NARROW_LAYERS); }
inline int is_half(int layer)
{
    return HALVED && layer < LAYERS && ARE_BEYOND(layer, FULL_LAYERS);
}

// Sums are modulo 2^32, or 2^64 where light above white needs more bits (LONG_SUMS).
#if LONG_SUMS
typedef ulong sum;
typedef ulong4 sum4;
typedef ulong8 sum8;
typedef ulong16 sum16;
#define TO_SUM(n, x) as_ulong##n(convert_long##n(x))
#else
typedef uint sum;
typedef uint4 sum4;
typedef uint8 sum8;
typedef uint16 sum16;
#define TO_SUM(n, x) as_uint##n(convert_int##n(x))
#endif

// SHEETS: the sums of a picture.  Those of the first have all colours.  Where a lens takes colours
// to different places, red, green and blue have sums of their own.
#define SHEETS (COLOURS > 1 ? COLOURS + 1 : 1)

// Each layer has an additional row and an additional pixel per row, for light that ends outside.
typedef struct {
    global sum4 *sums[ALL_LAYERS];
    int top, rows, width;
    float far;  // beyond every box that reaches a picture
} Strip;

// The number of a layer's pixels for `pixels` of the picture; halved layers have an additional one
// at each end.
inline int pixels_of(int pixels, int halved) { return halved ? (pixels + 1) / 2 + 2 : pixels; }

inline Strip make_strip(global sum4 *sums, int sheet, int strip, const SlicingArguments *n)
{
    const int strips = (n->height + n->strip_rows - 1) / n->strip_rows, top = strip * n->strip_rows;
    Strip s = {.top = top, .rows = min(n->strip_rows, n->height - top), .width = n->width,
               .far = 4.0f * max(n->width, n->height)};
    ulong count[ALL_LAYERS], all = 0;
    for (int layer = 0; layer < ALL_LAYERS; ++layer) {
        const int halved = is_half(layer), rows = pixels_of(n->strip_rows, halved) + 1;
        count[layer] = all;
        all += (ulong)rows * (pixels_of(n->width, halved) + 1);
    }
    for (int layer = 0; layer < ALL_LAYERS; ++layer)
        s.sums[layer] = sums + (ulong)(sheet * strips + strip) * all + count[layer];
    return s;
}

inline int pitch_of(const Strip *s, int layer)
{
    return pixels_of(s->width, is_half(layer)) + 1;
}
