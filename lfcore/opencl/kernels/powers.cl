// Powers of rows, and PQ (SMPTE ST 2084), which is made of them.
#pragma once
#include "lanes.cl"

// Inline logarithm and exponential to base 2: a library call would spill every vector register.
// Minimax polynomials: log2 of positive, normal numbers to
// 2.5e-7 relative to log2's own size near 1, exp2 to 1e-7 relative, and 0 below the least normal
// number.
inline vf log2_fast(vf x)
{
    const vi bits = AS_VI(x) - 0x3f3504f3;  // the bits of the square root of one half
    const vf t = AS_VF(AS_VI(x) - (bits & (vi)(0xff800000))) - 1.0f;
    vf p = -1.497330850e-01f;
    p = fma(p, t, (vf)(2.357095654e-01f));
    p = fma(p, t, (vf)(-2.483228387e-01f));
    p = fma(p, t, (vf)(2.868688860e-01f));
    p = fma(p, t, (vf)(-3.602634606e-01f));
    p = fma(p, t, (vf)(4.809311618e-01f));
    p = fma(p, t, (vf)(-7.213524874e-01f));
    p = fma(p, t, (vf)(1.442694922e+00f));
    return fma(p, t, TO_VF(bits >> 23));
}

inline vf exp2_fast(vf x)
{
    x = max(x, (vf)(-127.0f));
    const vf whole = floor(x + 0.5f), t = x - whole;
    vf p = 1.327647152e-03f;
    p = fma(p, t, (vf)(9.675541331e-03f));
    p = fma(p, t, (vf)(5.550713275e-02f));
    p = fma(p, t, (vf)(2.402211972e-01f));
    p = fma(p, t, (vf)(6.931469671e-01f));
    p = fma(p, t, (vf)(1.000000072e+00f));
    return p * AS_VF((TO_VI(whole) + 127) << 23);
}

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
