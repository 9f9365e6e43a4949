// Lane types: every kernel is written once over a row of LANES values (16, 8, 4 or 1).
//
// Comparisons give masks of -1 / 0 in an integer row for every width; OpenCL's own give 1 / 0 when
// the row is one value wide.
//
// Every width and every processor gives the same bits: no operation is used whose rounding OpenCL
// leaves open (native_*, half_*, mad, pow and their kin).  Contraction is off: the edge functions
// of two triangles that share an edge must be each other's negative to the last bit, and a product
// that is fused on one side only is not.  Where a fused multiply-add is wanted, fma() says so.
#ifndef LFCORE_LANES_CL
#define LFCORE_LANES_CL
#pragma OPENCL FP_CONTRACT OFF

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

// Rays of a block: BLOCK rows of BLOCK.
#define BLOCK 16
#define BLOCK_RAYS (BLOCK * BLOCK)

#if LANES == 1
// What kernels hint at is the width that they are written for.  A compiler that vectorises over
// work-items takes "float" as an invitation, though groups are of one: it spent three quarters of a
// build on copies that never run.
#define LANES_TYPE float4
typedef float vf;
typedef int vi;
typedef uint vu;
#define VLOAD(p) (*(p))
#define VSTORE(x, p) (*(p) = (x))
#define AS_VF as_float
#define AS_VI as_int
#define AS_VU as_uint
#define TO_VI convert_int
#define TO_VF convert_float
#define TO_VU convert_uint
#define MASK(m) (-(m))
#else
#define LANES_TYPE JOIN(float, LANES)
typedef JOIN(float, LANES) vf;
typedef JOIN(int, LANES) vi;
typedef JOIN(uint, LANES) vu;
#define VLOAD(p) JOIN(vload, LANES)(0, p)
#define VSTORE(x, p) JOIN(vstore, LANES)(x, 0, p)
#define AS_VF JOIN(as_float, LANES)
#define AS_VI JOIN(as_int, LANES)
#define AS_VU JOIN(as_uint, LANES)
#define TO_VI JOIN(convert_int, LANES)
#define TO_VF JOIN(convert_float, LANES)
#define TO_VU JOIN(convert_uint, LANES)
#define MASK(m) (m)
#endif

#define LT(a, b) MASK((a) < (b))
#define LE(a, b) MASK((a) <= (b))
#define GT(a, b) MASK((a) > (b))
#define GE(a, b) MASK((a) >= (b))
#define EQ(a, b) MASK((a) == (b))

// a where the mask is unset, b where it is set
inline vf pick(vf a, vf b, vi mask) { return AS_VF((AS_VI(a) & ~mask) | (AS_VI(b) & mask)); }
inline vi pick_int(vi a, vi b, vi mask) { return (a & ~mask) | (b & mask); }

// The sign bit turned where `sign` has it
inline vf flip_sign(vf a, vi sign) { return AS_VF(AS_VI(a) ^ sign); }

#if LANES == 16
#define IOTA ((vf)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define LANE_BITS ((vi)(1) << (vi)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15))
#define FOLD(op, x)                      \
    {                                    \
        JOIN(TYPE, 8) a8 = op(x.lo, x.hi); \
        JOIN(TYPE, 4) a4 = op(a8.lo, a8.hi); \
        JOIN(TYPE, 2) a2 = op(a4.lo, a4.hi); \
        return op(a2.lo, a2.hi);         \
    }
#elif LANES == 8
#define IOTA ((vf)(0, 1, 2, 3, 4, 5, 6, 7))
#define LANE_BITS ((vi)(1, 2, 4, 8, 16, 32, 64, 128))
#define FOLD(op, x)                      \
    {                                    \
        JOIN(TYPE, 4) a4 = op(x.lo, x.hi); \
        JOIN(TYPE, 2) a2 = op(a4.lo, a4.hi); \
        return op(a2.lo, a2.hi);         \
    }
#elif LANES == 4
#define IOTA ((vf)(0, 1, 2, 3))
#define LANE_BITS ((vi)(1, 2, 4, 8))
#define FOLD(op, x)                      \
    {                                    \
        JOIN(TYPE, 2) a2 = op(x.lo, x.hi); \
        return op(a2.lo, a2.hi);         \
    }
#else
#define IOTA 0.0f
#define LANE_BITS 1
#define FOLD(op, x) { return x; }
#endif

#define OR_(a, b) ((a) | (b))
#define TYPE float
inline float row_max(vf x) FOLD(max, x)
inline float row_min(vf x) FOLD(min, x)
#undef TYPE
#define TYPE int
inline int row_or(vi x) FOLD(OR_, x)
#undef TYPE
#define TYPE uint
inline uint row_least(vu x) FOLD(min, x)
inline uint row_most(vu x) FOLD(max, x)
#undef TYPE

// One bit per lane whose mask is set
inline uint row_bits(vi mask) { return (uint)row_or(mask & LANE_BITS); }
// and the mask of such bits
inline vi mask_of_bits(int bits) { return MASK(((vi)(bits) & LANE_BITS) != 0); }

// A comparison, not the sign bits themselves, is what compilers test in one instruction.
#if LANES == 1
inline int row_any(vi mask) { return mask != 0; }
#else
inline int row_any(vi mask) { return any(mask != 0); }
#endif

// Index of the lowest set bit
inline uint lowest(uint bits) { return popcount((bits & -bits) - 1u); }

// A component of a vector by its number, and the number of the largest
inline float axis(float3 v, int k) { return k == 0 ? v.x : k == 1 ? v.y : v.z; }
inline int largest_axis(float3 v)
{
    const float3 size = fabs(v);
    return size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
}

// Division and square root are rounded correctly, which tests/opencl/test_rounding.py tries for
// every mantissa.  The processor's approximations (native_recip, native_rsqrt) have 12 bits here
// and 14 there, and were no faster.
inline vf reciprocal(vf x) { return 1.0f / x; }
inline vf inverse_sqrt(vf x) { return 1.0f / sqrt(x); }

// In place of dot, cross, length and normalize, whose order and rounding each driver may choose.
inline float inner_product(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline float3 cross_product(float3 a, float3 b)
{
    return (float3)(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}

// What a length is at least where it is divided by: above the least normal float, 1.2e-38.
#define LEAST_LENGTH 1.0e-37f

// Length, and direction: of vectors whose squares a float cannot hold, too; nothing has no
// direction.
inline float largest_component(float3 a) { return max(fabs(a.x), max(fabs(a.y), fabs(a.z))); }
inline float norm(float3 a)
{
    const float most = largest_component(a);
    a /= max(most, LEAST_LENGTH);
    return most * sqrt(inner_product(a, a));
}
inline float3 direction_of(float3 a)
{
    a /= max(largest_component(a), LEAST_LENGTH);
    return a / max(norm(a), LEAST_LENGTH);
}

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

// Three numbers of each of a row.
typedef struct { vf x, y, z; } Vec;

inline vf dot3(Vec a, Vec b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
inline Vec scale3(Vec a, vf k) { const Vec r = {a.x * k, a.y * k, a.z * k}; return r; }
inline Vec minus3(Vec a, Vec b) { const Vec r = {a.x - b.x, a.y - b.y, a.z - b.z}; return r; }
inline Vec spread3(float3 a) { const Vec r = {(vf)(a.x), (vf)(a.y), (vf)(a.z)}; return r; }
inline Vec cross3(Vec a, Vec b)
{
    const Vec c = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    return c;
}
inline Vec pick3(Vec a, Vec b, vi mask)
{
    const Vec r = {pick(a.x, b.x, mask), pick(a.y, b.y, mask), pick(a.z, b.z, mask)};
    return r;
}

// Of three quantities of a block, (3, BLOCK_RAYS), the row that begins with ray `at`.
inline Vec load3(global const float *from, int at)
{
    from += at;
    const Vec r = {VLOAD(from), VLOAD(from + BLOCK_RAYS), VLOAD(from + 2 * BLOCK_RAYS)};
    return r;
}
inline void store3(Vec a, global float *to, int at)
{
    VSTORE(a.x, to + at);
    VSTORE(a.y, to + BLOCK_RAYS + at);
    VSTORE(a.z, to + 2 * BLOCK_RAYS + at);
}

#endif
