// What kernels compute where a bound counts its error, of one candidate of CANDIDATE numbers per
// work-item: a number that has the error, and the bound.  `leaf` holds equal triangles.
#include "numerics.cl"
#include "rectangles.cl"
#include "shadows.cl"

#define CANDIDATE 16
#define FIRST(v) ((const float *)&(v))[0]

// Corners p and q, steps s, t and of elements a, b, half extent, and a ray's x, y, u, v: twice the
// edge function there, widened by its bound.
kernel void edges(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    const Bundle r = {0, 0, 0, 0, in[6], in[6], in[7], in[7], in[8], in[9], in[10]};
    const Vec p = spread3(vload3(0, in)), q = spread3(vload3(1, in));
    const WideAffine wide = edge_function(&r, p, q);
    const vf error = edge_error(&r, p, q);
    Affine e = affine_of(&wide, 0);
    e.term[ONE] += FIRST(error);
    const vf value = bilinear_row(e, (Row){in[11], in[12], in[13], in[14]});
    vstore2((float2)(FIRST(value), FIRST(error)), get_global_id(0), out);
}

// An affine function and the half extent: its spread.
kernel void spreads(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    WideAffine e;
    for (int k = 0; k < AFFINE_TERMS; ++k) e.term[k] = in[k];
    const vf spread = affine_spread(e, in[10]) * BOUND_SLACK;
    vstore2((float2)(FIRST(spread), BOUND_SLACK - 1.0f), get_global_id(0), out);
}

// The rays about row and column c of an element of o, d, s and t.
inline Bundle rays_about(global const float *in, float c, float half_extent)
{
    const float s = in[4], t = in[5];
    return (Bundle){fma(c, s, in[0]), fma(c, s, in[1]), fma(c, t, in[2]), fma(c, t, in[3]),
                    s, s, t, t, 0, 0, half_extent};
}

// How a leaf's triangles lie along x among a bundle's rays.
inline Axis axis_of(const Bundle *r, global const Leaf *leaf)
{
    Triangles t;
    set_up_axes(r, leaf, 0, FAR, &t);
    return t.x;
}

// Rays about a packet's centre and a triangle: the first corner's x from the packet's centre ray.
kernel void corners(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    const Bundle all = rays_about(in, in[6], 31.5f);
    const Axis x = axis_of(&all, leaf + get_global_id(0));
    vstore2((float2)(FIRST(x.at.corner[0]), FIRST(x.error)), get_global_id(0), out);
}

// Likewise, of a block: the first column of an element that may see the triangle, and 0.
kernel void samples(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    Bundle r = rays_about(in, 0, 0.5f * (INNER - 1));
    r.a = in[8];
    r.b = in[9];
    const Axis x = axis_of(&r, leaf + get_global_id(0));
    vf lo, hi;
    find_span(&x, 0, &lo, &hi);
    vstore2((float2)(FIRST(lo), 0.0f), get_global_id(0), out);
}

// An affine function, a rectangle and the place of a ray in it: the value there, and the least that
// is assumed.
kernel void sides(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    const Affine f = {{in[0], in[1], in[2]}};
    const vf value = bilinear_row(f, (Row){in[7], in[8], 0, 0});
    const float least = least_over(f, (Rectangle){in[3], in[4], in[5], in[6]});
    vstore2((float2)(FIRST(value), least), get_global_id(0), out);
}

// A corner of a box, where it is after a time of 1, and the places of an obstacle's sides in its
// way along x and y: the ratio of the times that the kernels find.
kernel void sweeps(global const float *in, global Boxes *obstacle, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    obstacle += get_global_id(0);
    const float3 corner = vload3(0, in), rate = vload3(1, in) - corner;
    const Sweep sweep = make_sweep(corner, corner, rate, rate);
    vf near[2];
    for (int k = 0; k < 2; ++k) {
        for (int a = 0; a < 3; ++a) {
            obstacle->low[a][0] = a == k ? in[6 + k] : -FAR;
            obstacle->high[a][0] = FAR;
        }
        sweep_overlaps(&sweep, obstacle, 0, FAR, near + k);
    }
    vstore2((float2)(FIRST(near[0]) / FIRST(near[1]), SWEEP_SLACK - 1.0f), get_global_id(0), out);
}

// The float of a number in the floats' order.
inline float float_of(int order) { return as_float(order < 0 ? order ^ 0x7fffffff : order); }

// Likewise, and a depth: the largest x of a box there that the packet's frustum meets.
kernel void frusta(global const float *in, global Boxes *box, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    box += get_global_id(0);
    const Bundle all = rays_about(in, in[6], 31.5f);
    const Frustum frustum = make_frustum(&all);
    const float from[3] = {0, -FAR, in[9]}, to[3] = {FAR, FAR, in[9]};
    for (int k = 0; k < 3 * NODE_WIDTH; ++k) {
        box->low[k / NODE_WIDTH][k % NODE_WIDTH] = from[k / NODE_WIDTH];
        box->high[k / NODE_WIDTH][k % NODE_WIDTH] = to[k / NODE_WIDTH];
    }
    int low = as_int(FAR) ^ (int)0xffffffff, high = as_int(FAR);
    while (low < high) {
        const int middle = (int)(((long)low + high + 1) >> 1);
        for (int lane = 0; lane < NODE_WIDTH; ++lane) box->low[0][lane] = float_of(middle);
        const vi meets = frustum_overlaps(&frustum, box, 0, FAR);
        if (row_any(meets)) low = middle;
        else high = middle - 1;
    }
    vstore2((float2)(float_of(low), FRUSTUM_SLACK), get_global_id(0), out);
}

// A function a u + b v + g d + c, and the extremes of u, v and d over hit points: its value where
// that is largest, and the largest value that culling assumes.
kernel void pictures(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    const float a = in[0], b = in[1], g = in[2], c = in[3];
    Box hits;
    float at[3];
    for (int k = 0; k < 3; ++k) {
        hits.lo[k] = min(in[4 + k], in[7 + k]);
        hits.hi[k] = max(in[4 + k], in[7 + k]);
        at[k] = in[k] < 0.0f ? hits.lo[k] : hits.hi[k];
    }
    LightSpace space;
    set_range(&hits, &space);
    const float value = fma(at[2], g, fma(at[0], a, fma(at[1], b, c)));
    vf f[PICTURE_TERMS] = {a, b, g, c};
    f[MOST_C] = f[TERM_C] + picture_error(&space, f, 3);
    const vf most = most_in_picture(&space, f, 3);
    vstore2((float2)(value, FIRST(most)), get_global_id(0), out);
}

// Corners of a triangle beside a single ray, x and y: an edge function there, and its bound.
kernel void rays(global const float *in, global const Leaf *leaf, global float *out)
{
    in += CANDIDATE * get_global_id(0);
    Triple x, y;
    for (int k = 0; k < 3; ++k) {
        x.corner[k] = in[k];
        y.corner[k] = in[3 + k];
    }
    vf error;
    const Triple e = ray_edges(&x, &y, &error);
    vstore2((float2)(FIRST(e.corner[0]), FIRST(error)), get_global_id(0), out);
}

// How many spans shadow rays from `origins`, all wanted, are taken in, and how many rays they take.
kernel void spans(global const float *origins, global int *active, global int *out)
{
    const Shadows s = {.active = active, .origins = origins};
    const Bundle bundle = {.sx = 1.0e-4f, .tx = 1.0e-3f};
    global int *wanted = active + BLOCK_RAYS;
    for (int at = 0; at < BLOCK_RAYS; ++at) wanted[at] = -1;
    int count = 0, taken = 0;
    for (Box box; count <= BLOCK_RAYS && next_span(&s, &bundle, wanted, &box); ++count)
        for (int at = 0; at < BLOCK_RAYS; ++at) taken -= active[at];
    vstore2((int2)(count, taken), 0, out);
}
