// Rough mirrors: a ray meets one of the microfacets that it can see, and this one mirrors it.
//
// Source: J. Dupuy and A. Benyoub, "Sampling Visible GGX Normals with Spherical Caps", HPG 2023;
// T. Duff et al., "Building an Orthonormal Basis, Revisited", JCGT 6(1), 2017.
#pragma once
#include "surface.cl"

// The numbers of places on a grid, which may be a little off; without a pitch, scattered ones.
inline uint2 step_of(float2 place, float pitch)
{
    if (pitch > 0.0f) return as_uint2(convert_int2(floor(place / pitch + 0.25f)));
    uint2 a = as_uint2(place);
    a = (a ^ a >> 16) * 0x7feb352du + a.yx * 0x9e3779b1u;
    a = (a ^ a >> 15) * 0x846ca68bu;
    return a ^ a >> 16;
}

// Two numbers of a ray, in units of 2^-32.  The 64 rays through a pixel of a picture, which differ
// in lens samples i and pixels c of the slab, have all of 8 x 8 strata, and so have those that meet
// in another plane: a stratum depends on c modulo the rays of a pixel alone.  Its last digits are
// the middle of a round lens against its rim: the first ones must not be.  Within a stratum the
// numbers are a lattice over i and c.  Where a pitch is unknown, they are scattered.
inline uint2 numbers_of(float3 origin, float3 direction, const PathArguments *n)
{
    const int bits = n->lens_bits;
    const uint2 i = step_of(origin.xy, n->lens_pitch), c = step_of(direction.xy, n->pixel_pitch);
    const uint2 lens = i + 2u * i.yx;
    const uint2 reversed = (lens & 1u) << 2 | (lens & 2u) | (lens >> 2 & 1u);
    const uint2 stratum = (c << bits & 7u) | reversed >> 3 - bits;
    const uint2 lattice = c * 3242174889u + (uint2)(c.y, 0u - c.x) * 2447445414u +
                          i * 1640531527u + (uint2)(i.y, 0u - i.x) * 1013904223u;
    return (stratum << 29) + (lattice >> 3);
}

// Cosine and sine of the share x of a turn, from 0 to 1.
inline void cos_sin(vf x, vf *cosine, vf *sine)
{
    const vf quarter = floor(fma(x, (vf)(4.0f), (vf)(0.5f)));
    const vf y = fma(quarter, (vf)(-0.25f), x) * 6.28318531f, y2 = y * y;
    vf even = fma(y2, (vf)(-1.0f / 720.0f), (vf)(1.0f / 24.0f));
    even = fma(y2, fma(y2, even, (vf)(-0.5f)), (vf)(1.0f));
    vf odd = fma(y2, (vf)(-1.0f / 5040.0f), (vf)(1.0f / 120.0f));
    odd = fma(fma(y2, odd, (vf)(-1.0f / 6.0f)), y2 * y, y);
    const vi number = TO_VI(quarter), turned = -(number & 1);
    *cosine = flip_sign(pick(even, odd, turned), (number + 1 & 2) << 30);
    *sine = flip_sign(pick(odd, even, turned), (number & 2) << 30);
}

// The share of microfacets that nothing hides at a cosine: Smith's G1.
inline vf unhidden(vf cosine, vf alpha)
{
    const vf square = alpha * alpha;
    return 2.0f * cosine / (cosine + sqrt(fma(1.0f - square, cosine * cosine, square)));
}

// The normal of a microfacet that is seen, by numbers a and b from 0 to 1.
inline Vec find_facet(Vec normal, Vec to_viewer, vf alpha, vf a, vf b)
{
    const vf cosine = max(dot3(normal, to_viewer), (vf)(LEAST_LENGTH));
    // The ellipsoid of the microfacets as a sphere.
    const Vec across = scale3(fma3(-cosine, normal, to_viewer), alpha);
    const vf inverse = inverse_sqrt(fma(cosine, cosine, dot3(across, across)));
    const vf up = cosine * inverse, z = fma(-b, 1.0f + up, (vf)(1.0f));
    const vf radius = sqrt(max(fma(-z, z, (vf)(1.0f)), (vf)(0.0f)));
    const vi below = sign_of(normal.z);
    const vf one = flip_sign((vf)(1.0f), below), k = -1.0f / (one + normal.z);
    const vf turned = flip_sign(normal.x, below);
    const Vec s = {fma(normal.x * turned, k, (vf)(1.0f)), turned * normal.y * k, -turned};
    const Vec t = {normal.x * normal.y * k, fma(normal.y * normal.y, k, one), -normal.y};
    vf c, d;
    cos_sin(a, &c, &d);
    const Vec flat = fma3(radius * c, s, fma3(radius * d, t, scale3(across, inverse)));
    return directions_of(fma3(alpha, flat, scale3(normal, z + up)));
}

// The square root of the solid angle of a lobe that is everywhere as dense as where a microfacet
// mirrors light that has the cosine `up` to the normal.
inline vf lobe_width(vf cosine, vf up, vf alpha)
{
    const vf square = alpha * alpha, d = fma(up * up, square - 1.0f, (vf)(1.0f));
    const vf whole = sqrt(4.0f * M_PI_F * cosine / unhidden(cosine, alpha));
    return d * whole / max(alpha, (vf)(NOTHING_LEFT));
}
