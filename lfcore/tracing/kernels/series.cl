// Functions that vary little over a part of a block, as truncated Chebyshev series in two variables: values at 4 x 4 nodes
// give all coefficients up to the third degree along each axis.  What has degree 2 or less is kept; the
// rest, which falls by about a factor a degree, is computed to tell how much was cut off.
//
// Source: L. N. Trefethen, "Approximation Theory and Approximation Practice", 2013, chapters 3 and 8.
#ifndef LFCORE_SERIES_CL
#define LFCORE_SERIES_CL
#include "bundle.cl"

#define NODE_A 0.9238795325f  // cos(pi / 8)
#define NODE_B 0.3826834324f  // cos(3 pi / 8)

// From the values at the nodes of four functions, one a lane, their four coefficients each.
inline void transform_nodes(float4 *f)
{
    const float4 even = f[0] + f[3], inner = f[1] + f[2], odd = f[0] - f[3], twist = f[1] - f[2];
    f[0] = 0.25f * (even + inner);
    f[1] = 0.5f * (NODE_A * odd + NODE_B * twist);
    f[2] = 0.3535533906f * (even - inner);
    f[3] = 0.5f * (NODE_B * odd - NODE_A * twist);
}

#if OUTER == 1
#define NODES 16
constant float node_columns[NODES] = {NODE_A, NODE_B, -NODE_B, -NODE_A, NODE_A, NODE_B, -NODE_B, -NODE_A,
                                      NODE_A, NODE_B, -NODE_B, -NODE_A, NODE_A, NODE_B, -NODE_B, -NODE_A};
constant float node_rows[NODES] = {NODE_A, NODE_A, NODE_A, NODE_A, NODE_B, NODE_B, NODE_B, NODE_B,
                                   -NODE_B, -NODE_B, -NODE_B, -NODE_B, -NODE_A, -NODE_A, -NODE_A, -NODE_A};

// Places (column, row) counted from a block's centre: a middle, and half extents.
typedef struct { float x, y, wide, high; } Rectangle;

// Around columns from `left` to `right` and rows from `top` to `bottom`.
inline Rectangle rectangle_of(float left, float right, float top, float bottom)
{
    Rectangle r = {0.5f * (left + right) - HALF, 0.5f * (top + bottom) - HALF, 0.5f * (right - left), 0.5f * (bottom - top)};
    return r;
}

// Depths between which rays in a rectangle of a block meet a plane, depth over / under, that all see from
// one side: extremes are in the corners.
inline float2 corner_depths(Form over, Form under, Rectangle at)
{
    const float4 x = (float4)(-at.wide, at.wide, -at.wide, at.wide) + at.x, y = (float4)(-at.high, -at.high, at.high, at.high) + at.y;
    const float4 z = fma(x, over.i, fma(y, over.j, over.c)) / fma(x, under.i, fma(y, under.j, under.c));
    return (float2)(min(min(z.x, z.y), min(z.z, z.w)), max(max(z.x, z.y), max(z.z, z.w)));
}

// LANES nodes, from node `at` on, as places on the block.
typedef struct { vf x, y; } Places;
inline Places nodes_at(const Rectangle *over, int at)
{
    Places p = {fma(VLOAD(node_columns + at), (vf)(over->wide), (vf)(over->x)),
                fma(VLOAD(node_rows + at), (vf)(over->high), (vf)(over->y))};
    return p;
}
inline vf form_nodes(Form f, Places at) { return fma(at.x, (vf)(f.i), fma(at.y, (vf)(f.j), (vf)(f.c))); }

// Coefficients of the products of T_p along x and T_q along y: row[p] has those of q = 0 to 3.
typedef struct { float4 row[4]; } Series;

inline Series make_series(private const float *values)
{
    float4 f[4], t[4];
    for (int k = 0; k < 4; ++k) f[k] = vload4(k, values);
    transform_nodes(f);
    t[0] = (float4)(f[0].x, f[1].x, f[2].x, f[3].x);
    t[1] = (float4)(f[0].y, f[1].y, f[2].y, f[3].y);
    t[2] = (float4)(f[0].z, f[1].z, f[2].z, f[3].z);
    t[3] = (float4)(f[0].w, f[1].w, f[2].w, f[3].w);
    transform_nodes(t);
    Series s = {{t[0], t[1], t[2], t[3]}};
    return s;
}

// Bounds of the series: of what varies, and of the terms above the second degree.
inline float series_spread(const Series *s)
{
    const float4 sum = fabs(s->row[0]) + fabs(s->row[1]) + fabs(s->row[2]) + fabs(s->row[3]);
    return sum.x + sum.y + sum.z + sum.w - fabs(s->row[0].x);
}

inline float series_rest(const Series *s)
{
    const float4 sum = fabs(s->row[3]) + (float4)(0.0f, fabs(s->row[2].yzw)) + (float4)(0.0f, 0.0f, fabs(s->row[1].zw));
    return sum.x + sum.y + sum.z + sum.w + fabs(s->row[0].w);
}

// What is kept, by places counted from the rectangle's middle.
typedef struct { float c, x, y, xx, xy, yy; } Quadratic;

inline Quadratic truncate(const Series *s, const Rectangle *over)
{
    const float x = over->wide > 0.0f ? 1.0f / over->wide : 0.0f, y = over->high > 0.0f ? 1.0f / over->high : 0.0f;
    Quadratic f = {s->row[0].x - s->row[2].x - s->row[0].z, s->row[1].x * x, s->row[0].y * y,
                   2.0f * s->row[2].x * x * x, s->row[1].y * x * y, 2.0f * s->row[0].z * y * y};
    return f;
}

inline Quadratic scale_quadratic(Quadratic f, float by)
{
    Quadratic scaled = {f.c * by, f.x * by, f.y * by, f.xx * by, f.xy * by, f.yy * by};
    return scaled;
}

// Quadratics in red, green and blue.
typedef struct { float4 c, x, y, xx, xy, yy; } Tint;

inline Tint add_tinted(Tint f, Quadratic g, float4 by)
{
    Tint sum = {fma(by, (float4)(g.c), f.c), fma(by, (float4)(g.x), f.x), fma(by, (float4)(g.y), f.y),
                fma(by, (float4)(g.xx), f.xx), fma(by, (float4)(g.xy), f.xy), fma(by, (float4)(g.yy), f.yy)};
    return sum;
}

// Such a function with its places counted from (a, b).
#define ABOUT(f, a, b)                                                                                         \
    {f.c + a * f.x + b * f.y + a * a * f.xx + a * b * f.xy + b * b * f.yy, f.x + 2.0f * a * f.xx + b * f.xy, \
     f.y + 2.0f * b * f.yy + a * f.xy, f.xx, f.xy, f.yy}
inline Quadratic about(Quadratic f, float a, float b) { Quadratic g = ABOUT(f, a, b); return g; }
inline Tint tint_about(Tint f, float a, float b) { Tint g = ABOUT(f, a, b); return g; }

// What such a function's first and second degree are at most within (wide, high).
#define SLOPE(f, wide, high) (fabs(f.x) * wide + fabs(f.y) * high)
#define BEND(f, wide, high) (fabs(f.xx) * (wide * wide) + fabs(f.xy) * (wide * high) + fabs(f.yy) * (high * high))

// The product of two up to the second degree; `rest` receives a bound of what is cut off.
inline Quadratic multiply(Quadratic f, Quadratic g, float wide, float high, float *rest)
{
    const float bend_f = BEND(f, wide, high), bend_g = BEND(g, wide, high);
    *rest = SLOPE(f, wide, high) * bend_g + (SLOPE(g, wide, high) + bend_g) * bend_f;
    Quadratic p = {f.c * g.c, fma(f.c, g.x, f.x * g.c), fma(f.c, g.y, f.y * g.c),
                   fma(f.c, g.xx, fma(f.x, g.x, f.xx * g.c)),
                   fma(f.c, g.xy, fma(f.x, g.y, fma(f.y, g.x, f.xy * g.c))),
                   fma(f.c, g.yy, fma(f.y, g.y, f.yy * g.c))};
    return p;
}

// The same of colours, plus `sum`.  What has the third degree is economised: x^3 and x^2 y are 3/4 wide^2 x and 1/2 wide^2 y
// up to 1/4 and 1/2 of their size.
inline Tint multiply_tints(Tint f, Tint g, Tint sum, float wide, float high, float4 *rest)
{
    const float ww = wide * wide, hh = high * high;
    const float4 xxx = fma(f.x, g.xx, f.xx * g.x), yyy = fma(f.y, g.yy, f.yy * g.y);
    const float4 xxy = fma(f.x, g.xy, fma(f.y, g.xx, fma(f.xx, g.y, f.xy * g.x)));
    const float4 xyy = fma(f.x, g.yy, fma(f.y, g.xy, fma(f.xy, g.y, f.yy * g.x)));
    *rest = 0.25f * (fabs(xxx) * (ww * wide) + fabs(yyy) * (hh * high)) + 0.5f * (fabs(xxy) * (ww * high) + fabs(xyy) * (wide * hh)) +
            BEND(f, wide, high) * BEND(g, wide, high);
    Tint p = {fma(f.c, g.c, sum.c),
              fma(f.c, g.x, fma(f.x, g.c, fma(xxx, (float4)(0.75f * ww), fma(xyy, (float4)(0.5f * hh), sum.x)))),
              fma(f.c, g.y, fma(f.y, g.c, fma(yyy, (float4)(0.75f * hh), fma(xxy, (float4)(0.5f * ww), sum.y)))),
              fma(f.c, g.xx, fma(f.x, g.x, fma(f.xx, g.c, sum.xx))),
              fma(f.c, g.xy, fma(f.x, g.y, fma(f.y, g.x, fma(f.xy, g.c, sum.xy)))),
              fma(f.c, g.yy, fma(f.y, g.y, fma(f.yy, g.c, sum.yy)))};
    return p;
}

// The same down LANES columns.
typedef struct { vf c, y; float yy; } Column;

inline Column down_column(Quadratic f, vf x)
{
    Column d = {fma(x, fma(x, (vf)(f.xx), (vf)(f.x)), (vf)(f.c)), fma(x, (vf)(f.xy), (vf)(f.y)), f.yy};
    return d;
}

inline vf column_at(Column f, vf y) { return fma(y, fma(y, (vf)(f.yy), f.y), f.c); }
#endif

#endif
