// Cut-outs: triangles with holes.  Where a ray meets one, the alpha of its texture says whether it
// passes.
//
// Texture coordinates are affine in the place on a triangle's plane, so two forms of it give them
// to every kind of ray alike: camera rays of blocks and single ones, and rays to lights.
#ifndef LFCORE_CUT_OUTS_CL
#define LFCORE_CUT_OUTS_CL
#include "block.cl"

// What textures do in a scene, bits of TEXTURES.
#define TEXTURED (TEXTURES & 1)
#define CUT_OUTS (TEXTURES >> 1 & 1)

typedef struct {
    global const int *of;     // (T,) a triangle's record; -1: no holes
    // (C, 3) of a place P: u = n . P + c, v likewise; offset, width and height of the alpha, and
    // the least that is no hole, in codes.
    global const float4 *records;
    global const uchar *alpha;
} CutOuts;

#define CUT_OUT_PARAMETERS                \
    global const int *restrict cut_of,    \
    global const float4 *restrict cuts,   \
    global const uchar *restrict alpha
#define MAKE_CUT_OUTS {cut_of, cuts, alpha}

inline int has_holes(const CutOuts *c, int triangle) { return CUT_OUTS && c->of[triangle] >= 0; }

// Alpha at texture coordinates in turns, v up, bilinear and wrapping, in codes.
inline float alpha_at(global const uchar *alpha, int4 image, float u, float v)
{
    const float x = fma(u - floor(u), (float)image.y, -0.5f);
    const float y = fma(1.0f - (v - floor(v)), (float)image.z, -0.5f);
    const float left = floor(x), top = floor(y), fx = x - left, fy = y - top;
    // What is no number must not become an address.
    const int x0 = clamp(convert_int(left), -1, image.y - 1);
    const int y0 = clamp(convert_int(top), -1, image.z - 1);
    const int xa = x0 < 0 ? image.y - 1 : x0, xb = x0 + 1 < image.y ? x0 + 1 : 0;
    global const uchar *above = alpha + image.x + (y0 < 0 ? image.z - 1 : y0) * image.y;
    global const uchar *below = alpha + image.x + (y0 + 1 < image.z ? y0 + 1 : 0) * image.y;
    const float high = fma(fx, (float)above[xb] - (float)above[xa], (float)above[xa]);
    const float low = fma(fx, (float)below[xb] - (float)below[xa], (float)below[xa]);
    return fma(fy, low - high, high);
}

// Whether a triangle stops a ray that meets it at `place`.
inline int is_solid(const CutOuts *c, int triangle, float3 place)
{
    if (!has_holes(c, triangle)) return 1;
    global const float4 *record = c->records + 3 * c->of[triangle];
    const float4 u = record[0], v = record[1];
    const int4 image = as_int4(record[2]);
    const float at_u = fma(place.x, u.x, fma(place.y, u.y, fma(place.z, u.z, u.w)));
    const float at_v = fma(place.x, v.x, fma(place.y, v.y, fma(place.z, v.z, v.w)));
    return alpha_at(c->alpha, image, at_u, at_v) >= as_float(image.w);
}

// Of a row of rays, `bits` of which meet a triangle at `depth`, those that it stops.
inline uint stopped_rays(const CutOuts *c, int triangle, const Bundle *r, Row row, vf depth,
                         uint bits)
{
    private float x[LANES], y[LANES], z[LANES];
    VSTORE(fma(depth, row_dx(r, row), row_ox(r, row)), x);
    VSTORE(fma(depth, (vf)(row_dy(r, row)), (vf)(row_oy(r, row))), y);
    VSTORE(depth, z);
    uint stopped = 0;
    for (uint left = bits; left; left &= left - 1) {
        const uint k = lowest(left);
        stopped |= (uint)is_solid(c, triangle, (float3)(x[k], y[k], z[k])) << k;
    }
    return stopped;
}

#endif
