// Shadows on a block that lies on one triangle of one element.
#ifndef LFCORE_HOMOGRAPHY_CL
#define LFCORE_HOMOGRAPHY_CL
#include "occluders.cl"

#if OUTER == 1

// A block on one triangle: the hit point times the denominator of depth is affine over the block (rays
// of a pixel meet in its focus point, rays of a view in the lens sample: a homography either way), so
// the occluders' forms are too, and are tested like triangles in triangles.cl.
typedef struct {
    float3 c, i, j;     // (P - apex) * weight
    float wc, wi, wj;   // weight, positive over the block
} Receiver;

inline Receiver make_receiver(const Bundle *r, const BlockState *state, float3 apex)
{
    const float zc = state->over.c, zi = state->over.i, zj = state->over.j;
    const float wc = state->under.c, wi = state->under.i, wj = state->under.j;
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
inline void facet_bounds(const Bundle *r, const BlockState *state, float *lo, float *hi)
{
    for (int k = 0; k < 3; ++k) { lo[k] = FAR; hi[k] = -FAR; }
    for (int k = 0; k < 4; ++k) {
        const float x = k & 1 ? HALF : -HALF, y = k & 2 ? HALF : -HALF;
        const Form over = state->over, under = state->under;
        const float z = (over.c + x * over.i + y * over.j) / (under.c + x * under.i + y * under.j);
        const float p[3] = {fma(x, r->sx, r->ox) + z * fma(x, r->tx, r->dx), fma(y, r->sy, r->oy) + z * fma(y, r->ty, r->dy), z};
        for (int axis = 0; axis < 3; ++axis) {
            const float slack = 1.0e-6f * fabs(p[axis]);
            lo[axis] = min(lo[axis], p[axis] - slack);
            hi[axis] = max(hi[axis], p[axis] + slack);
        }
    }
}

#else
typedef void Receiver;
#endif

#endif
