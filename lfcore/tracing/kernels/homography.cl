// Shadows on the rays of one element that meet one triangle.
#ifndef LFCORE_HOMOGRAPHY_CL
#define LFCORE_HOMOGRAPHY_CL
#include "occluders.cl"
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

// What a form is at most over the receiver's rectangle.
inline vf most_over(Affine e, const Rectangle *at)
{
    const vf middle = fma(e.i, (vf)(at->x), fma(e.j, (vf)(at->y), e.c));
    return fma(fabs(e.i), (vf)(at->wide), fma(fabs(e.j), (vf)(at->high), middle));
}

// Mask of the LANES occluders in `may` that can darken a receiver.  What a hit point is off its plane is a fraction of
// SHADOW_MARGIN; half of that keeps whatever could darken a ray, and drops neighbours in one plane.
inline vi darkens(const Receiver *f, const ShadowRays *r, const Plane *planes, vi may)
{
    const Rectangle *over = &f->over;
    const float most = f->wc + fabs(f->wi) * (fabs(over->x) + over->wide) + fabs(f->wj) * (fabs(over->y) + over->high);
    for (int k = 3; k >= 0; --k) {
        const Plane p = planes[k];
        const vf size = fma(fabs(p.n.x), (vf)(r->size.x), fma(fabs(p.n.y), (vf)(r->size.y), fma(fabs(p.n.z), (vf)(r->size.z), fabs(p.c))));
        may &= GE(fma(size, (vf)(0.5f * SHADOW_MARGIN * most), most_over(project_plane(f, p), over)), (vf)(0.0f));
        if (!row_any(may)) break;
    }
    return may;
}

// Affine forms of LANES occluders over a receiver, and the rows each can darken.  `covers` receives whether one of
// them darkens every ray.
inline uint project_occluders(const Receiver *f, const Plane *planes, vi may, private float *out, private int *rows, int *covers)
{
    const Rectangle *over = &f->over;
    vi all = may;
    *covers = 0;
    vf first = over->y - over->high + HALF, last = over->y + over->high + HALF;
    for (int k = 3; k >= 0; --k) {
        const Affine e = project_plane(f, planes[k]);
        const vf middle = fma(e.i, (vf)(over->x), fma(e.j, (vf)(over->y), e.c));
        const vf wide = fma(fabs(e.i), (vf)(over->wide), fabs(e.j) * over->high);
        may &= GE(middle + wide, (vf)(0.0f));
        all &= GT(middle, wide * 1.00001f);
        if (!row_any(may)) return 0;
        narrow_rows(e, (vi)(0), &first, &last);
        VSTORE(e.c, out + 3 * k * LANES);
        VSTORE(e.i, out + (3 * k + 1) * LANES);
        VSTORE(e.j, out + (3 * k + 2) * LANES);
    }
    *covers = row_any(all);
    store_rows(first, last, rows);
    return row_bits(may & LE(first, last));
}

// Darken the rays of a block behind one occluder: all of them, or, given `ids`, those on triangle `own`.  False when
// none is left.  No branches within: which rays an occluder reaches cannot be foreseen.
inline int cast_on_facet(private const float *f, uint lane, int first, int last, global const int *ids, int own, global int *wants)
{
    Form c[4];
    for (int k = 0; k < 4; ++k) c[k] = read_flat(f + 3 * k * LANES, lane);
    vi dark = 0;
    for (int column = 0; column < BLOCK; column += LANES) {
        vf e[4];
        for (int k = 0; k < 4; ++k) e[k] = fma(IOTA + (column - HALF), (vf)(c[k].i), (vf)(c[k].c));
        for (int row = first; row <= last; ++row) {
            const int at = row * BLOCK + column;
            const vf y = row - HALF;
            const vf edges = min(fma(y, (vf)(c[0].j), e[0]), min(fma(y, (vf)(c[1].j), e[1]), fma(y, (vf)(c[2].j), e[2])));
            vi behind = GE(edges, (vf)(0.0f)) & GT(fma(y, (vf)(c[3].j), e[3]), (vf)(0.0f));
            if (ids) behind &= EQ(VLOAD(ids + at), (vi)(own));
            VSTORE(VLOAD(wants + at) & ~behind, wants + at);
            dark |= behind;
        }
    }
    if (!row_any(dark)) return 1;
    vi left = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) left |= VLOAD(wants + at) & (ids ? EQ(VLOAD(ids + at), (vi)(own)) : (vi)(-1));
    return row_any(left);
}

// Darken all of those rays.
inline void darken_all(global const int *ids, int own, global int *wants)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(ids ? VLOAD(wants + at) & ~EQ(VLOAD(ids + at), (vi)(own)) : (vi)(0), wants + at);
}

// Darken them behind LANES occluders; false when none is left.
inline int cast_occluders(const Receiver *f, const Plane *planes, vi may, global const int *ids, int own, global int *wants)
{
    private float forms[12 * LANES];
    private int rows[2 * LANES];
    int covers;
    uint keep = project_occluders(f, planes, may, forms, rows, &covers);
    if (covers) {
        darken_all(ids, own, wants);
        return 0;
    }
    for (; keep; keep &= keep - 1) {
        const uint k = lowest(keep);
        if (!cast_on_facet(forms, k, rows[k], rows[LANES + k], ids, own, wants)) return 0;
    }
    return 1;
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
    return dot(a, b) + 1.00001f * dot(fabs(a), db) + 1.00001f * dot(da, fabs(b) + db) + 1.0e-6f * dot(fabs(a), fabs(b));
}

// Whether no ray of a block on one triangle, whose hit points lo and hi bound, meets a side that faces the light.
inline int turned_away(const Facet *f, const Bundle *r, global const float *light, const float *lo, const float *hi)
{
#if SMOOTH
    const float3 n = (float3)(f->n[0].c, f->n[1].c, f->n[2].c);
    const float3 dn = HALF * (float3)(fabs(f->n[0].i) + fabs(f->n[0].j), fabs(f->n[1].i) + fabs(f->n[1].j), fabs(f->n[2].i) + fabs(f->n[2].j));
    // Normals are turned to the viewer, and may all have to be turned or none.
    const float3 view = (float3)(r->dx, r->dy, 1.0f), dview = HALF * (float3)(fabs(r->tx), fabs(r->ty), 0.0f);
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
    }
    return most_dot(sign * n, dn, l, dl) < 0.0f;
}

#else
typedef void Receiver;
#endif

#endif
