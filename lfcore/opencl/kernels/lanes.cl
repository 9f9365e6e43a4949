// Lane types: every kernel is written once over a row of LANES values (16, 8, 4 or 1).  Comparisons
// give masks of -1 / 0 in an integer row; OpenCL's own give 1 / 0 where a row is one value wide.
//
// Every width and every processor gives the same bits: operations whose rounding OpenCL leaves open
// are not used (native_*, half_*, mad, pow and similar ones).  Contraction is off: triangles that
// share an edge must have edge functions that are each other's negative to the last bit.
#pragma once
#pragma OPENCL FP_CONTRACT OFF
#include "kernel.cl"

// A float's bits: the exponent has this bias, above this many bits of the fraction.
#define FLOAT_BIAS 127
#define FRACTION_BITS 23

#define JOIN_(a, b) a##b
#define JOIN(a, b) JOIN_(a, b)

#if LANES == 1
#define LANES_TYPE float4
#define WIDE(name) name
#define VLOAD(p) (*(p))
#define VSTORE(x, p) (*(p) = (x))
#define MASK(m) (-(m))
#else
#define LANES_TYPE vf
#define WIDE(name) JOIN(name, LANES)
#define VLOAD(p) WIDE(vload)(0, p)
#define VSTORE(x, p) WIDE(vstore)(x, 0, p)
#define MASK(m) (m)
#endif
#define KERNEL KERNEL_OF(LANES_TYPE)
typedef WIDE(float) vf;
typedef WIDE(int) vi;
typedef WIDE(uint) vu;
#define AS_VF WIDE(as_float)
#define AS_VI WIDE(as_int)
#define AS_VU WIDE(as_uint)
#define TO_VF WIDE(convert_float)
#define TO_VI WIDE(convert_int)
#define TO_VU WIDE(convert_uint)

#define LT(a, b) MASK((a) < (b))
#define LE(a, b) MASK((a) <= (b))
#define GT(a, b) MASK((a) > (b))
#define GE(a, b) MASK((a) >= (b))
#define EQ(a, b) MASK((a) == (b))

// a where the mask is unset, b where it is set
inline vf pick(vf a, vf b, vi mask) { return AS_VF((AS_VI(a) & ~mask) | (AS_VI(b) & mask)); }
inline vi pick_int(vi a, vi b, vi mask) { return (a & ~mask) | (b & mask); }

// The sign bit of a, and a with its sign flipped where `sign` is set
inline vi sign_of(vf a) { return AS_VI(a) & (vi)(0x80000000); }
inline vf flip_sign(vf a, vi sign) { return AS_VF(AS_VI(a) ^ sign); }

#define NUMBERS1 0
#define NUMBERS4 0, 1, 2, 3
#define NUMBERS8 NUMBERS4, 4, 5, 6, 7
#define NUMBERS16 NUMBERS8, 8, 9, 10, 11, 12, 13, 14, 15
#define LANE_NUMBERS JOIN(NUMBERS, LANES)
#define IOTA ((vf)(LANE_NUMBERS))
#define LANE_BITS ((vi)(1) << (vi)(LANE_NUMBERS))

// `op` over the lanes of a row, half by half.
#define FOLD1(type, op, x) return x;
#define FOLD2(type, op, x) return op(x.lo, x.hi);
#define FOLD4(type, op, x) const type##2 x2 = op(x.lo, x.hi); FOLD2(type, op, x2)
#define FOLD8(type, op, x) const type##4 x4 = op(x.lo, x.hi); FOLD4(type, op, x4)
#define FOLD16(type, op, x) const type##8 x8 = op(x.lo, x.hi); FOLD8(type, op, x8)
#define FOLD JOIN(FOLD, LANES)
#define OR_(a, b) ((a) | (b))
inline float row_max(vf x) { FOLD(float, max, x) }
inline float row_min(vf x) { FOLD(float, min, x) }
inline int row_or(vi x) { FOLD(int, OR_, x) }

// One bit per lane whose mask is set, and the mask of such bits
inline uint row_bits(vi mask) { return (uint)row_or(mask & LANE_BITS); }
inline vi mask_of_bits(int bits) { return MASK(((vi)(bits) & LANE_BITS) != 0); }

inline int row_any(vi mask) { return any(MASK(mask != 0)); }  // compiles to one instruction

inline uint lowest(uint bits) { return popcount((bits & -bits) - 1u); }  // index of that set bit

// Division and square root are rounded correctly, as tests/opencl/test_rounding.py shows.
inline vf reciprocal(vf x) { return 1.0f / x; }
inline vf inverse_sqrt(vf x) { return 1.0f / sqrt(x); }

// Three numbers per ray of a row: coordinates or colours.
typedef struct { vf x, y, z; } Vec;

inline vf dot3(Vec a, Vec b) { return fma(a.x, b.x, fma(a.y, b.y, a.z * b.z)); }
inline Vec scale3(Vec a, vf k) { return (Vec){a.x * k, a.y * k, a.z * k}; }
inline Vec times3(Vec a, Vec b) { return (Vec){a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec plus3(Vec a, Vec b) { return (Vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec minus3(Vec a, Vec b) { return (Vec){a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec absolute3(Vec a) { return (Vec){fabs(a.x), fabs(a.y), fabs(a.z)}; }
inline Vec spread3(float3 a) { return (Vec){(vf)(a.x), (vf)(a.y), (vf)(a.z)}; }
inline Vec turn_vectors(Vec a, vi sign)
{
    return (Vec){flip_sign(a.x, sign), flip_sign(a.y, sign), flip_sign(a.z, sign)};
}
// k a + b, rounded once.
inline Vec fma3(vf k, Vec a, Vec b)
{
    return (Vec){fma(k, a.x, b.x), fma(k, a.y, b.y), fma(k, a.z, b.z)};
}
inline Vec cross3(Vec a, Vec b)
{
    return (Vec){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec pick3(Vec a, Vec b, vi mask)
{
    return (Vec){pick(a.x, b.x, mask), pick(a.y, b.y, mask), pick(a.z, b.z, mask)};
}

// A value per corner p, q and r of LANES triangles, such as coordinates along one axis.
typedef struct { vf corner[3]; } Triple;

// The geometric normals of LANES triangles with corners v: twice their area long.
inline Vec geometric_normals(const Vec *v)
{
    return cross3(minus3(v[1], v[0]), minus3(v[2], v[0]));
}

inline vf least3(Triple a) { return min(a.corner[0], min(a.corner[1], a.corner[2])); }
inline vf most3(Triple a) { return max(a.corner[0], max(a.corner[1], a.corner[2])); }
inline vf largest3(Triple a) { return max(fabs(least3(a)), fabs(most3(a))); }
