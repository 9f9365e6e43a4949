// Shadows on a block that lies on one triangle of one element.
#ifndef LFCORE_HOMOGRAPHY_CL
#define LFCORE_HOMOGRAPHY_CL
#include "occluders.cl"
#include "shading.cl"

#if OUTER == 1

// A block on one triangle: the hit point times the denominator of depth is affine over the block (rays
// of a pixel meet in its focus point, rays of a view in the lens sample: a homography either way), so
// the occluders' forms are too, and are tested like triangles in triangles.cl.
typedef struct {
    float3 c, i, j;     // (P - apex) * weight
    float wc, wi, wj;   // weight, positive over the block
} Receiver;

inline Receiver make_receiver(const Bundle *r, const Facet *facet, float3 apex)
{
    const float zc = facet->over.c, zi = facet->over.i, zj = facet->over.j;
    const float wc = facet->under.c, wi = facet->under.i, wj = facet->under.j;
    Receiver f = {(float3)(r->ox * wc + zc * r->dx, r->oy * wc + zc * r->dy, zc) - apex * wc,
                  (float3)(r->sx * wc + r->ox * wi + zi * r->dx + zc * r->tx, r->oy * wi + zi * r->dy, zi) - apex * wi,
                  (float3)(r->ox * wj + zj * r->dx, r->sy * wc + r->oy * wj + zj * r->dy + zc * r->ty, zj) - apex * wj,
                  wc, wi, wj};
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

// Receivers of a block of several triangles: one of each, as if it filled the block.
#define RECEIVERS 8
typedef struct {
    Receiver of[RECEIVERS];
    int count;          // 0 where they are too many, or one is seen edge-on
} Receivers;

inline void make_receivers(const Bundle *r, const Facets *facets, float3 apex, Receivers *out)
{
    out->count = 0;
    if (facets->lost) return;
    for (int k = 0; k < SLOTS; ++k) {
        if (facets->id[k] < 0) continue;
        if (out->count == RECEIVERS || !one_sided(facets->facet + k)) {
            out->count = 0;
            return;
        }
        out->of[out->count++] = make_receiver(r, facets->facet + k, apex);
    }
}

// Mask of the LANES occluders in `may` that can darken one of the receivers.  What a hit point is off its plane is
// a fraction of SHADOW_MARGIN; half of that keeps whatever could darken a ray, and drops neighbours in one plane.
inline vi darkens_some(const Receivers *receivers, const ShadowRays *r, const Plane *planes, vi may)
{
    vf noise[4];
    for (int k = 0; k < 4; ++k) {
        const Plane f = planes[k];
        noise[k] = 0.5f * SHADOW_MARGIN * fma(fabs(f.n.x), (vf)(r->size.x), fma(fabs(f.n.y), (vf)(r->size.y), fma(fabs(f.n.z), (vf)(r->size.z), fabs(f.c))));
    }
    vi some = 0;
    for (int k = 0; k < receivers->count; ++k) {
        const Receiver *f = receivers->of + k;
        const float most = f->wc + HALF * (fabs(f->wi) + fabs(f->wj));
        vi darkens = may;
        for (int edge = 3; edge >= 0; --edge) {
            const Affine e = project_plane(f, planes[edge]);
            darkens &= GE(e.c + fma(noise[edge], (vf)(most), spread(e)), (vf)(0.0f));
            if (!row_any(darkens)) break;
        }
        some |= darkens;
    }
    return some;
}

// Affine forms of LANES occluders over a receiver's block, and the rows each can darken.
inline uint project_occluders(const Receiver *f, const Plane *planes, vi may, private float *out, private int *rows)
{
    vf first = 0.0f, last = 2.0f * HALF;
    for (int k = 0; k < 4; ++k) {
        const Affine e = project_plane(f, planes[k]);
        may &= GE(e.c + spread(e), (vf)(0.0f));
        narrow_rows(e, (vi)(0), &first, &last);
        VSTORE(e.c, out + 3 * k * LANES);
        VSTORE(e.i, out + (3 * k + 1) * LANES);
        VSTORE(e.j, out + (3 * k + 2) * LANES);
    }
    store_rows(first, last, rows);
    return row_bits(may);
}

// Darken the rays of a receiver's block behind one occluder; false when none is left.
inline int cast_on_facet(private const float *f, uint lane, int first, int last, global int *wants)
{
    Form c[4];
    for (int k = 0; k < 4; ++k) c[k] = read_flat(f + 3 * k * LANES, lane);
    for (int at = first * BLOCK; at < (last + 1) * BLOCK; at += LANES) {
        const Row row = row_at(at);
        const vf a = form_row(c[0], row), b = form_row(c[1], row), g = form_row(c[2], row), beyond = form_row(c[3], row);
        const vi dark = GE(min(a, min(b, g)), (vf)(0.0f)) & GT(beyond, (vf)(0.0f));
        if (row_any(dark)) VSTORE(VLOAD(wants + at) & ~dark, wants + at);
    }
    vi left = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) left |= VLOAD(wants + at);
    return row_any(left);
}

// Bounds of a block that lies on one triangle: the image of a rectangle is spanned by its corners.
inline void facet_bounds(const Bundle *r, const Facet *f, float *lo, float *hi)
{
    for (int k = 0; k < 3; ++k) { lo[k] = FAR; hi[k] = -FAR; }
    for (int k = 0; k < 4; ++k) {
        const float x = k & 1 ? HALF : -HALF, y = k & 2 ? HALF : -HALF;
        const Form over = f->over, under = f->under;
        const float z = (over.c + x * over.i + y * over.j) / (under.c + x * under.i + y * under.j);
        const float p[3] = {fma(x, r->sx, r->ox) + z * fma(x, r->tx, r->dx), fma(y, r->sy, r->oy) + z * fma(y, r->ty, r->dy), z};
        for (int axis = 0; axis < 3; ++axis) {
            const float slack = 1.0e-6f * fabs(p[axis]);
            lo[axis] = min(lo[axis], p[axis] - slack);
            hi[axis] = max(hi[axis], p[axis] + slack);
        }
    }
}

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
typedef void Receivers;
#endif

#endif
