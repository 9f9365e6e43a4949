// PQ (SMPTE ST 2084), the coding of light above white.
#pragma once
#include "powers.cl"

#define PQ_M1 (2610.0f / 16384.0f)
#define PQ_M2 (2523.0f / 32.0f)
#define PQ_C1 (3424.0f / 4096.0f)
#define PQ_C2 (2413.0f / 128.0f)
#define PQ_C3 (2392.0f / 128.0f)

// Codes in [0, 1] of light times `scale`; less than 1e-12 is black.
inline vf encode_pq(vf light, float scale)
{
    const vf share = clamp(light * scale, (vf)(1.0e-12f), (vf)(1.0f));
    const vf power = exp2_fast(PQ_M1 * log2_fast(share));
    const vf code = fma(power, (vf)(PQ_C2), (vf)(PQ_C1)) / fma(power, (vf)(PQ_C3), (vf)(1.0f));
    return exp2_fast(PQ_M2 * log2_fast(code));
}

// Light in [0, 1] of codes, which are clamped.
inline vf decode_pq(vf code)
{
    const vf held = clamp(code, (vf)(1.0e-30f), (vf)(1.0f));
    const vf power = exp2_fast((1.0f / PQ_M2) * log2_fast(held));
    const vf share = max(power - PQ_C1, (vf)(1.0e-30f)) / fma(power, (vf)(-PQ_C3), (vf)(PQ_C2));
    return exp2_fast((1.0f / PQ_M1) * log2_fast(share));
}
