// Highlights of Blinn-Phong materials.
//
// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH
// 1977.
#pragma once
#include "samples.cl"

// Logarithm and exponential to base 2 in line: a call of the library's would spill every vector
// register.  Polynomials fitted to the least largest error; log2 of positive, normal numbers to
// 2.5e-7 relative to log2's own size near 1, exp2 to 1e-7 relative, and 0 below the least normal
// number.
inline vf log2_fast(vf x)
{
    const vi bits = AS_VI(x) - 0x3f3504f3;  // of the square root of one half
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

// A highlight: a power of the cosine between the normal and halfway to the viewer.
inline vf highlight(const Surface *s, Vec towards, vi facing)
{
    const Vec h = plus3(towards, s->to_viewer);
    const vf halfway = dot3(s->normal, h) * inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT)));
    const vi glossy = facing & GE(halfway, (vf)(s->material->specular_cutoff));
    if (!row_any(glossy)) return 0.0f;
    const vf cosine = max(halfway, (vf)(NOTHING_LEFT));
    const vf power = exp2_fast(s->material->shininess * log2_fast(cosine));
    return pick((vf)(0.0f), power, glossy);
}
