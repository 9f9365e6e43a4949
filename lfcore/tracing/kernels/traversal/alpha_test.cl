// Alpha test: triangles with holes.  A ray passes a hit if the texture's alpha is below the
// material's cutoff.
//
// Texture coordinates are affine functions of the hit point on a triangle's plane.  So all rays use
// the same two functions: blocks' camera rays, single camera rays, and shadow rays.
#pragma once
#include "block.cl"
#include "one_ray.cl"

// 1 if a scene has triangles with holes.
#define ALPHA_TESTS ((TEXTURES & ALPHA_TESTS_BIT) != 0)

typedef struct {
    global const int *record_of;         // (T,) a triangle's record; -1: no alpha
    global const AlphaTest *records;  // (C,)
    global const uchar *alpha;     // pictures of codes
} AlphaTests;

// Whether a triangle has a picture of alpha.
inline int has_holes(const AlphaTests *c, int triangle)
{
    return ALPHA_TESTS && c->record_of[triangle] >= 0;
}

// Alpha in codes at texture coordinates in repeats, v up, bilinear and wrapping.
inline float alpha_at(global const uchar *alphas, global const AlphaTest *image, float u, float v)
{
    const int width = image->width, height = image->height;
    global const uchar *alpha = alphas + image->offset;
    const float x = fma(u - floor(u), (float)width, -0.5f);
    const float y = fma(1.0f - (v - floor(v)), (float)height, -0.5f);
    const float left = floor(x), top = floor(y), fx = x - left, fy = y - top;
    // NaN must not become an address.
    const int x0 = clamp(convert_int(left), -1, width - 1);
    const int y0 = clamp(convert_int(top), -1, height - 1);
    const int xa = x0 < 0 ? width - 1 : x0, xb = x0 + 1 < width ? x0 + 1 : 0;
    global const uchar *above = alpha + (y0 < 0 ? height - 1 : y0) * width;
    global const uchar *below = alpha + (y0 + 1 < height ? y0 + 1 : 0) * width;
    const float high = fma(fx, (float)above[xb] - (float)above[xa], (float)above[xa]);
    const float low = fma(fx, (float)below[xb] - (float)below[xa], (float)below[xa]);
    return fma(fy, low - high, high);
}

// Alpha in codes at a point on a triangle.
inline float alpha_of(const AlphaTests *c, global const AlphaTest *record, float3 point)
{
    const float4 u = vload4(0, record->u), v = vload4(0, record->v);
    const float at_u = fma(point.x, u.x, fma(point.y, u.y, fma(point.z, u.z, u.w)));
    const float at_v = fma(point.x, v.x, fma(point.y, v.y, fma(point.z, v.z, v.w)));
    return alpha_at(c->alpha, record, at_u, at_v);
}

// Whether a triangle stops a ray that hits it at `point`.
inline int is_solid(const AlphaTests *c, int triangle, float3 point)
{
    if (!has_holes(c, triangle)) return 1;
    global const AlphaTest *record = c->records + c->record_of[triangle];
    return alpha_of(c, record, point) >= record->least;
}

// The rays among `bits` of a row, which hit a triangle at `depth`, that the triangle stops.
inline uint stopped_rays(const AlphaTests *c, int triangle, const Bundle *r, Row row, vf depth,
                         uint bits)
{
    const Vec d = direction_row(r, row), o = {row_ox(r, row), (vf)(row_oy(r, row)), (vf)(0.0f)};
    const Vec point = fma3(depth, d, o);
    uint stopped = 0;
    for (uint left = bits; left; left &= left - 1) {
        const uint k = lowest(left);
        stopped |= (uint)is_solid(c, triangle, ray_vector(&point, k)) << k;
    }
    return stopped;
}
