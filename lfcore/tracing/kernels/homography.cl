// Shadows on the rays of one element that meet one triangle.
#ifndef LFCORE_HOMOGRAPHY_CL
#define LFCORE_HOMOGRAPHY_CL
#include "darkness.cl"
#include "shares.cl"

#if OUTER == 1

// Rays of a block that meet one triangle: the hit point times the denominator of depth is affine over the block
// (rays of a pixel meet in its focus point, rays of a view in the lens sample: a homography either way), so
// the occluders' forms are too, and are tested like triangles in triangles.cl.
typedef struct {
    float3 c, i, j;         // (P - apex) * weight
    float wc, wi, wj;       // weight, positive over the rectangle
    Rectangle over;         // around the rays
} Receiver;

inline Receiver make_receiver(const Bundle *r, const Facet *facet, Rectangle over, float3 apex)
{
    const float zc = facet->over.c, zi = facet->over.i, zj = facet->over.j;
    const float wc = facet->under.c, wi = facet->under.i, wj = facet->under.j;
    Receiver f = {(float3)(r->ox * wc + zc * r->dx, r->oy * wc + zc * r->dy, zc) - apex * wc,
                  (float3)(r->sx * wc + r->ox * wi + zi * r->dx + zc * r->tx, r->oy * wi + zi * r->dy, zi) - apex * wi,
                  (float3)(r->ox * wj + zj * r->dx, r->sy * wc + r->oy * wj + zj * r->dy + zc * r->ty, zj) - apex * wj,
                  wc, wi, wj, over};
    return f;
}

inline Affine project_plane(const Receiver *f, Plane p)
{
    Affine e;
    e.c = fma(p.n.x, (vf)(f->c.x), fma(p.n.y, (vf)(f->c.y), fma(p.n.z, (vf)(f->c.z), p.c * f->wc)));
    e.i = fma(p.n.x, (vf)(f->i.x), fma(p.n.y, (vf)(f->i.y), fma(p.n.z, (vf)(f->i.z), p.c * f->wi)));
    e.j = fma(p.n.x, (vf)(f->j.x), fma(p.n.y, (vf)(f->j.y), fma(p.n.z, (vf)(f->j.z), p.c * f->wj)));
    return e;
}

// Darken what lies behind LANES occluders of those on a receiver; false when none is left.
inline int cast_planes(const Receiver *f, const Plane *planes, vi may, Darkness *d)
{
    Affine e[4];
    for (int k = 0; k < 4; ++k) e[k] = project_plane(f, planes[k]);
    return cast_occluders(e, may, d);
}

// Bounds of what a bundle sees in a rectangle of its block from depth `near` to `far`.
inline void bundle_bounds(const Bundle *r, Rectangle at, float near, float far, float *lo, float *hi)
{
    const float8 x = (float8)(-at.wide, at.wide, -at.wide, at.wide, -at.wide, at.wide, -at.wide, at.wide) + at.x;
    const float8 y = (float8)(-at.high, -at.high, at.high, at.high, -at.high, -at.high, at.high, at.high) + at.y;
    const float8 z = (float8)((float4)(near), (float4)(far));
    const float8 p[2] = {fma(x, r->sx, r->ox) + z * fma(x, r->tx, r->dx), fma(y, r->sy, r->oy) + z * fma(y, r->ty, r->dy)};
    for (int k = 0; k < 2; ++k) {
        const float4 low = min(p[k].lo, p[k].hi), high = max(p[k].lo, p[k].hi);
        lo[k] = min(min(low.x, low.y), min(low.z, low.w));
        hi[k] = max(max(high.x, high.y), max(high.z, high.w));
    }
    lo[2] = near;
    hi[2] = far;
    for (int k = 0; k < 3; ++k) {
        const float slack = 1.0e-6f * max(fabs(lo[k]), fabs(hi[k]));
        lo[k] -= slack;
        hi[k] += slack;
    }
}

// Depths of a facet over a rectangle that sees it from one side.
inline float2 facet_depths(const Facet *f, Rectangle at) { return corner_depths(f->over, f->under, at); }

// Bounds of a dot product: the largest value of a . b with each coordinate off by up to da and db.
inline float most_dot(float3 a, float3 da, float3 b, float3 db)
{
    return inner_product(a, b) + 1.00001f * inner_product(fabs(a), db) + 1.00001f * inner_product(da, fabs(b) + db) + 1.0e-6f * inner_product(fabs(a), fabs(b));
}

// Whether no ray in a rectangle that meets one triangle, between lo and hi, meets a side that faces the light, or the light
// turns its back on all of them.
inline int turned_away(const Facet *f, const Bundle *r, Rectangle at, global const float *light, const float *lo, const float *hi)
{
#if SMOOTH
    const float3 c = f->of.c.s012, i = f->of.i.s012, j = f->of.j.s012;
    const float3 n = fma(i, at.x, fma(j, at.y, c)), noise = 1.0e-6f * (fabs(i * at.x) + fabs(j * at.y) + fabs(c));
    const float3 dn = fma(fabs(i), at.wide, fma(fabs(j), at.high, noise));
    // Normals are turned to the viewer, and may all have to be turned or none.
    const float3 view = (float3)(fma(at.x, r->tx, r->dx), fma(at.y, r->ty, r->dy), 1.0f);
    const float3 dview = (float3)(at.wide * fabs(r->tx), at.high * fabs(r->ty), 0.0f);
    const float sign = most_dot(n, dn, view, dview) < 0.0f ? 1.0f : most_dot(-n, dn, view, dview) < 0.0f ? -1.0f : 0.0f;
    if (sign == 0.0f) return 0;
#else
    const float3 n = f->normal, dn = 0.0f;
    const float sign = 1.0f;
#endif
    float3 l = vload3(0, light), dl = 0.0f;
    if (IS_POINT(light)) {
        const float3 low = vload3(0, lo), high = vload3(0, hi);
        dl = 0.5f * (high - low) + 1.0e-6f * fabs(l);
        l -= 0.5f * (low + high);
#if EMITTERS
        if (most_dot(-vload3(0, light + LIGHT_NORMAL), 0.0f, l, dl) < 0.0f) return 1;
#endif
    }
    return most_dot(sign * n, dn, l, dl) < 0.0f;
}

#endif
#endif
