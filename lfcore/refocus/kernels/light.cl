// Linear light of video frames, planar green, blue, red or BT.709 YCbCr of limited range: BITS is 8,
// or 10 or 12 (in 16-bit samples), PQ 1 for PQ, else sRGB.
#pragma once
#include "pq.cl"
#include "samples.cl"

#define SCALE (1.0f / CODES)
#define LIGHT_ONE (PQ ? PQ_ONE : FIXED_ONE)  // of the brightest code

// IEC 61966-2-1 decoding of sRGB-encoded values to fixed point; those outside [0, 1] are clamped.
// Above the knee a minimax polynomial with an error of 2e-6, below it the straight line.
#define KNEE 0.04045f
#define POWER(T, x)                                                                            \
    fma(fma(fma(fma(fma(fma(fma((T)(6.519284021e+04f), x, (T)(-2.910779674e+05f)), x,     \
        (T)(5.707602639e+05f)), x, (T)(-6.955071952e+05f)), x, (T)(8.436951737e+05f)), x, \
        (T)(5.182544125e+05f)), x, (T)(3.634786102e+04f)), x, (T)(-2.369988653e+03f))
// Below 0 the line continues, and is cut at the end; TOP is where the polynomial reaches one.
#define TOP 0.9999993f
#define LINEAR(T, x)                                          \
    max(fma(min(x, (T)(KNEE)), (T)(FIXED_ONE / 12.92f),       \
            POWER(T, clamp(x, (T)(KNEE), (T)(TOP)))),         \
        (T)(0.0f))

// By way of signed integers: every processor converts to them in one instruction.
inline vu linear_row(vf x)
{
    return AS_VU(TO_VI(PQ ? fma(decode_pq(x), (vf)(LIGHT_ONE), (vf)(0.5f)) : LINEAR(vf, x)));
}

// Three colours of one ray.
inline void linear_ray(float r, float g, float b, uint light[3])
{
#if PQ
    private float encoded[16] = {r, g, b};
    private uint row[16];
    for (int k = 0; k < 3; k += LANES) VSTORE(linear_row(VLOAD(encoded + k)), row + k);
    for (int k = 0; k < 3; ++k) light[k] = row[k];
#else
    light[0] = convert_int(LINEAR(float, r));
    light[1] = convert_int(LINEAR(float, g));
    light[2] = convert_int(LINEAR(float, b));
#endif
}

// Red, green and blue of the three samples of a ray (T is vf or float), encoded, not clamped.
#define TO_RGB(T, is_rgb, first, second, third, r, g, b)                                       \
    T r, g, b;                                                                                 \
    if (is_rgb) {                                                                              \
        r = (third) * (1.0f / 255.0f), g = (first) * (1.0f / 255.0f);                          \
        b = (second) * (1.0f / 255.0f);                                                        \
    } else {                                                                                   \
        const T luma = fma((first), (T)(1.0f / 219.0f), (T)(-16.0f / 219.0f));                 \
        const T cb = (second) - 128.0f, cr = (third) - 128.0f;                                 \
        r = fma(cr, (T)(1.5748f / 224.0f), luma), b = fma(cb, (T)(1.8556f / 224.0f), luma);    \
        g = fma(cr, (T)(-0.2126f * 1.5748f / 0.7152f / 224.0f),                                \
                fma(cb, (T)(-0.0722f * 1.8556f / 0.7152f / 224.0f), luma));                    \
    }
