// Powers of rows.
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
    return fma(p, t, TO_VF(bits >> FRACTION_BITS));
}

inline vf exp2_fast(vf x)
{
    x = max(x, (vf)(-FLOAT_BIAS));
    const vf whole = floor(x + 0.5f), t = x - whole;
    vf p = 1.327647152e-03f;
    p = fma(p, t, (vf)(9.675541331e-03f));
    p = fma(p, t, (vf)(5.550713275e-02f));
    p = fma(p, t, (vf)(2.402211972e-01f));
    p = fma(p, t, (vf)(6.931469671e-01f));
    p = fma(p, t, (vf)(1.000000072e+00f));
    return p * AS_VF((TO_VI(whole) + FLOAT_BIAS) << FRACTION_BITS);
}
