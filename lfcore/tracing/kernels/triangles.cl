// Triangles against a bundle: affine edge functions, set up once per block.
//
// In the frame sheared to the block's centre ray, X = x - ox - z dx (Y alike), the edge function of
// p -> q, D . ((p - O) x (q - O)), is affine over the block: the term in O x O vanishes, and so does
// the bilinear one, for lens samples of one pixel as for pixels of one lens sample.  It is
//     e = c_z + i (c_x tx + g_y sx) + j (c_y ty - g_x sy),   c = P x Q,  g = P - Q
// of which twice is kept.
// The three edges sum to n . D, and depth is the weighted mean (Z_p e_qr + Z_q e_rp + Z_r e_pq) / sum.
#ifndef LFCORE_TRIANGLES_CL
#define LFCORE_TRIANGLES_CL
#include "bundle.cl"

// Coefficients of LANES triangles, a row of LANES each: the edges opposite p, q, r (EDGE rows each),
// numerator and denominator of depth (FLAT rows each).
#if OUTER > 1
#define EDGE 6
#define FLAT 5
#else
#define EDGE 3
#define FLAT 3
#endif
#define COEFFICIENTS (3 * EDGE + 2 * FLAT)

// A Form for each of LANES triangles.
typedef struct {
    vf c, i, j;
#if OUTER > 1
    vf p, q, k;
#endif
} Affine;

// Twice the edge function: P x Q = (P + Q) x (Q - P) / 2.  The difference of two corners that are near
// each other is exact, so the error scales with the triangle's edge, and not with the distance to the block's
// centre as that of P x Q does; swapping P and Q negates it to the last bit all the same.
inline Affine edge(vf px, vf py, vf pz, vf qx, vf qy, vf qz, const Bundle *r)
{
    const vf sx = px + qx, sy = py + qy, sz = pz + qz, dx = qx - px, dy = qy - py, dz = qz - pz;
    const vf cx = sy * dz - sz * dy, cy = sz * dx - sx * dz;
    Affine e;
    e.c = sx * dy - sy * dx;
    e.i = fma(cx, (vf)(r->tx), -2.0f * dy * r->sx);
    e.j = fma(cy, (vf)(r->ty), 2.0f * dx * r->sy);
#if OUTER > 1
    e.p = fma(cx, (vf)(r->b), -2.0f * dy * r->a);
    e.q = fma(cy, (vf)(r->b), 2.0f * dx * r->a);
    e.k = dz * (-2.0f * (r->sx * r->b - r->a * r->tx));
#endif
    return e;
}

// Bound of the rounding error of such a form anywhere in the block: sum,
// difference, product and their difference are four roundings of each term, its evaluation at a ray two more, or
// four.
inline vf edge_noise(vf px, vf py, vf pz, vf qx, vf qy, vf qz, const Bundle *r)
{
    const vf sx = fabs(px + qx), sy = fabs(py + qy), sz = fabs(pz + qz), dx = fabs(qx - px), dy = fabs(qy - py), dz = fabs(qz - pz);
    const vf cx = fma(sy, dz, sz * dy), cy = fma(sz, dx, sx * dz);
    const vf wide = fma(cx, (vf)(fabs(r->tx)), 2.0f * dy * fabs(r->sx)) + fma(cy, (vf)(fabs(r->ty)), 2.0f * dx * fabs(r->sy));
#if OUTER > 1
    const vf outer = fma(cx + cy, (vf)(fabs(r->b)), 2.0f * (dx + dy) * fabs(r->a));
    const vf both = dz * (4.0f * HALF * OUTER_HALF * (fabs(r->sx * r->b) + fabs(r->a * r->tx)));
    return 4.8e-7f * (fma((vf)(HALF), wide, fma(sx, dy, sy * dx)) + fma((vf)(OUTER_HALF), outer, both));
#else
    return 3.6e-7f * fma((vf)(HALF), wide, fma(sx, dy, sy * dx));
#endif
}

// What a form varies by within the block, at most.
inline vf spread(Affine e)
{
    const vf wide = HALF * (fabs(e.i) + fabs(e.j));
#if OUTER > 1
    return wide + OUTER_HALF * (fabs(e.p) + fabs(e.q)) + 2.0f * HALF * OUTER_HALF * fabs(e.k);
#else
    return wide;
#endif
}

typedef struct {
    uint keep;     // lanes that may be hit
    uint cover;    // of those, lanes that every ray of the block is inside of
    uint mixed;    // lanes seen edge-on by some ray: the sign of n . D changes within the block
} Cull;

// Bound of the rounding error of sheared corners a, b, c and of where the block's rays pass them, along
// an axis of steps s and t and centre direction d.
inline vf corner_noise(vf a, vf b, vf c, vf z_most, float s, float t, float d, const Bundle *r, float extent)
{
    const float o_wide = extent * fabs(s) + OUTER_HALF * fabs(r->a), d_wide = fabs(d) + extent * fabs(t) + OUTER_HALF * fabs(r->b);
    return 4.0e-7f * (max(fabs(a), max(fabs(b), fabs(c))) + fma(z_most, (vf)(d_wide), (vf)(o_wide)));
}

// Triangles whose sheared corners a, b, c lie wholly beside the block along one axis, whichever way they
// face: at depth z the block reaches extent |s + z t|, and as much for its elements, convex in z.
inline vi beside_block(vf a, vf b, vf c, vf z_lo, vf z_hi, vf noise, float s, float t, const Bundle *r, float extent)
{
    const vf near = fma(z_lo, (vf)(t), (vf)(s)), far = fma(z_hi, (vf)(t), (vf)(s));
#if OUTER > 1
    const vf from = fma((vf)(extent), fabs(near), OUTER_HALF * fabs(fma(z_lo, (vf)(r->b), (vf)(r->a))));
    const vf to = fma((vf)(extent), fabs(far), OUTER_HALF * fabs(fma(z_hi, (vf)(r->b), (vf)(r->a))));
    const vf reach = fma(max(from, to), (vf)(1.00001f), noise);
#else
    const vf reach = fma((vf)(extent * 1.00001f), max(fabs(near), fabs(far)), noise);
#endif
    return GT(min(a, min(b, c)), reach) | LT(max(a, max(b, c)), -reach);
}

#if OUTER > 1
// The block's 16 places along one axis that triangles of sheared corners a, b, c can reach, a bit each.  At
// depth z neighbouring rays of the inner grid are s + z t apart, and those of neighbouring elements r->a + z r->b;
// for each element the extremes are the corners' as long as the former keeps its sign over the triangle.
inline vi places_reached(vf a, vf b, vf c, vf az, vf bz, vf cz, vf noise, float s, float t, const Bundle *r)
{
    const vf wa = fma(az, (vf)(t), (vf)(s)), wb = fma(bz, (vf)(t), (vf)(s)), wc = fma(cz, (vf)(t), (vf)(s));
    const vf ua = fma(az, (vf)(r->b), (vf)(r->a)), ub = fma(bz, (vf)(r->b), (vf)(r->a)), uc = fma(cz, (vf)(r->b), (vf)(r->a));
    const vf ra = reciprocal(wa), rb = reciprocal(wb), rc = reciprocal(wc);
    const vf slack = fma(noise, max(fabs(ra), max(fabs(rb), fabs(rc))), (vf)(0.01f));
    vi places = 0;
    for (int k = 0; k < OUTER; ++k) {
        const vf u = OUTER_HALF - k;
        const vf ia = fma(u, ua, a) * ra, ib = fma(u, ub, b) * rb, ic = fma(u, uc, c) * rc;
        const vf lo = ceil(min(ia, min(ib, ic)) - slack + HALF), hi = floor(max(ia, max(ib, ic)) + slack + (HALF + 1.0f));
        const vi first = TO_VI(clamp(lo, (vf)(0.0f), (vf)(INNER))), end = TO_VI(clamp(hi, (vf)(0.0f), (vf)(INNER)));
        places |= (((vi)(1) << end) - ((vi)(1) << first)) << (k * INNER);
    }
    const vi same = GT(wa * wb, (vf)(0.0f)) & GT(wb * wc, (vf)(0.0f));
    return pick_int((vi)((1 << BLOCK) - 1), places, same);
}
#else
// Samples [first, last] along one axis, from 0 to 2 extent, that triangles of sheared corners a, b,
// c can reach.  At depth z neighbouring rays are s + z t apart; while that keeps its sign over the triangle,
// the extremes are its corners' (a projective map), and what falls between two samples is found out.
inline void span_samples(vf a, vf b, vf c, vf az, vf bz, vf cz, vf noise, float s, float t, float extent, vf *first,
                         vf *last)
{
    const vf wa = fma(az, (vf)(t), (vf)(s)), wb = fma(bz, (vf)(t), (vf)(s)), wc = fma(cz, (vf)(t), (vf)(s));
    const vf ra = reciprocal(wa), rb = reciprocal(wb), rc = reciprocal(wc);
    const vf ia = a * ra, ib = b * rb, ic = c * rc;
    const vf slack = fma(noise, max(fabs(ra), max(fabs(rb), fabs(rc))), (vf)(0.01f));
    const vi same = GT(wa * wb, (vf)(0.0f)) & GT(wb * wc, (vf)(0.0f));
    const vf lo = ceil(min(ia, min(ib, ic)) - slack + extent), hi = floor(max(ia, max(ib, ic)) + slack + extent);
    *first = max(pick((vf)(0.0f), lo, same), (vf)(0.0f));
    *last = min(pick((vf)(2.0f * extent), hi, same), (vf)(2.0f * extent));
}

// Of the rows [first, last], counted from 0, those where a form can be non-negative, rounding allowed for:
// e.c + HALF |e.i| + (row - HALF) e.j >= 0.
inline void narrow_rows(Affine e, vi mixed, vf *first, vf *last)
{
    const vf wide = HALF * fabs(e.i);
    const vf at = -(e.c + wide + 1.0e-6f * (fabs(e.c) + wide)) / e.j;
    *first = pick(*first, max(*first, ceil(at + (HALF - 0.01f))), GT(e.j, (vf)(1.0e-30f)) & ~mixed);
    *last = pick(*last, min(*last, floor(at + (HALF + 0.01f))), LT(e.j, (vf)(-1.0e-30f)) & ~mixed);
}


// No row at all where first is beyond last.
inline void store_rows(vf first, vf last, private int *rows)
{
    VSTORE(clamp(TO_VI(first), (vi)(0), (vi)(BLOCK)), rows);
    VSTORE(clamp(TO_VI(last), (vi)(-1), (vi)(BLOCK - 1)), rows + LANES);
}
#endif

inline void store_flat(Affine f, private float *out)
{
    VSTORE(f.c, out); VSTORE(f.i, out + LANES); VSTORE(f.j, out + 2 * LANES);
#if OUTER > 1
    VSTORE(f.p, out + 3 * LANES); VSTORE(f.q, out + 4 * LANES);
#endif
}

inline void store_edge(Affine e, private float *out)
{
    VSTORE(e.c, out); VSTORE(e.i, out + LANES); VSTORE(e.j, out + 2 * LANES);
#if OUTER > 1
    VSTORE(e.p, out + 3 * LANES); VSTORE(e.q, out + 4 * LANES); VSTORE(e.k, out + 5 * LANES);
#endif
}

inline Affine flip_edge(Affine e, vi sign)
{
    e.c = flip_sign(e.c, sign); e.i = flip_sign(e.i, sign); e.j = flip_sign(e.j, sign);
#if OUTER > 1
    e.p = flip_sign(e.p, sign); e.q = flip_sign(e.q, sign); e.k = flip_sign(e.k, sign);
#endif
    return e;
}

inline Affine sum_edges(Affine a, Affine b, Affine c)
{
    Affine n;
    n.c = a.c + b.c + c.c; n.i = a.i + b.i + c.i; n.j = a.j + b.j + c.j;
#if OUTER > 1
    n.p = a.p + b.p + c.p; n.q = a.q + b.q + c.q;
    n.k = 0.0f;  // the three differences of depth cancel
#endif
    return n;
}

// Corners of LANES triangles in the frame of the block's centre ray.
typedef struct { vf px, py, pz, qx, qy, qz, rx, ry, rz; } Corners;

inline Corners shear_corners(const Bundle *r, global const float *leaf)
{
    Corners c;
    c.pz = VLOAD(leaf + 32); c.qz = VLOAD(leaf + 80); c.rz = VLOAD(leaf + 128);
    c.px = fma(-c.pz, r->dx, VLOAD(leaf) - r->ox); c.py = fma(-c.pz, r->dy, VLOAD(leaf + 16) - r->oy);
    c.qx = fma(-c.qz, r->dx, VLOAD(leaf + 48) - r->ox); c.qy = fma(-c.qz, r->dy, VLOAD(leaf + 64) - r->oy);
    c.rx = fma(-c.rz, r->dx, VLOAD(leaf + 96) - r->ox); c.ry = fma(-c.rz, r->dy, VLOAD(leaf + 112) - r->oy);
    return c;
}

// Depth from the plane n . X = n . P: n is made of edges, so its error scales with the triangle
// and not with its distance, as that of the weights does.
inline void plane_forms(const Corners *v, const Bundle *r, vi flip, Affine *over, Affine *under)
{
    const vf ax = v->qx - v->px, ay = v->qy - v->py, az = v->qz - v->pz, bx = v->rx - v->px, by = v->ry - v->py, bz = v->rz - v->pz;
    const vf nx = flip_sign(ay * bz - az * by, flip), ny = flip_sign(az * bx - ax * bz, flip), nz = flip_sign(ax * by - ay * bx, flip);
    over->c = fma(nx, v->px, fma(ny, v->py, nz * v->pz)); over->i = -nx * r->sx; over->j = -ny * r->sy;
    under->c = nz; under->i = nx * r->tx; under->j = ny * r->ty;
#if OUTER > 1
    over->p = -nx * r->a; over->q = -ny * r->a; over->k = 0.0f;
    under->p = nx * r->b; under->q = ny * r->b; under->k = 0.0f;
#endif
}

// The edges of LANES triangles opposite p, q and r, and the bounds of their rounding errors.
typedef struct {
    Affine e0, e1, e2;
    vf noise0, noise1, noise2;
} Edges;

inline Edges make_edges(const Corners *v, const Bundle *r)
{
    Edges e;
    e.e0 = edge(v->qx, v->qy, v->qz, v->rx, v->ry, v->rz, r);
    e.e1 = edge(v->rx, v->ry, v->rz, v->px, v->py, v->pz, r);
    e.e2 = edge(v->px, v->py, v->pz, v->qx, v->qy, v->qz, r);
    e.noise0 = edge_noise(v->qx, v->qy, v->qz, v->rx, v->ry, v->rz, r);
    e.noise1 = edge_noise(v->rx, v->ry, v->rz, v->px, v->py, v->pz, r);
    e.noise2 = edge_noise(v->px, v->py, v->pz, v->qx, v->qy, v->qz, r);
    return e;
}

// How triangles lie to all the rays of the block.
typedef struct {
    vi meets;   // some ray may meet it
    vi covers;  // every ray does
    vi mixed;   // seen edge-on by some ray: the sign of n . D changes
    vi flip;    // sign bit of those that were seen from behind
} Lie;

inline Edges turn_edges(Edges e, vi flip)
{
    e.e0 = flip_edge(e.e0, flip); e.e1 = flip_edge(e.e1, flip); e.e2 = flip_edge(e.e2, flip);
    return e;
}

// Finds it, signs edges so that n . D > 0 unless mixed, and then widens them.
inline Lie lie_of(Edges *e)
{
    const Affine n = sum_edges(e->e0, e->e1, e->e2);
    const vf w = spread(n);
    const vi flat = EQ(n.c, (vf)(0.0f)) & EQ(w, (vf)(0.0f));
    Lie lie;
    lie.mixed = LE(fabs(n.c), w * 1.00001f);
    lie.flip = LT(n.c, (vf)(0.0f)) & ~lie.mixed & (vi)(0x80000000);
    *e = turn_edges(*e, lie.flip);
    e->e0.c += pick((vf)(0.0f), e->noise0, ~lie.mixed);
    e->e1.c += pick((vf)(0.0f), e->noise1, ~lie.mixed);
    e->e2.c += pick((vf)(0.0f), e->noise2, ~lie.mixed);
    // A rounding error of the evaluation at a ray must not be culled away: a little slack.
    const vf slack = 1.00001f;
    const vf w0 = spread(e->e0) * slack, w1 = spread(e->e1) * slack;
    const vf w2 = spread(e->e2) * slack;
    const vf tiny = 1.0e-30f;
    const vi outside = LT(e->e0.c + w0, -tiny) | LT(e->e1.c + w1, -tiny) | LT(e->e2.c + w2, -tiny);
    lie.covers = GE(e->e0.c, w0 + tiny) & GE(e->e1.c, w1 + tiny) & GE(e->e2.c, w2 + tiny) & ~lie.mixed;
    lie.meets = ~(flat | (outside & ~lie.mixed));
    return lie;
}

inline void store_edges(const Edges *e, private float *out)
{
    store_edge(e->e0, out); store_edge(e->e1, out + EDGE * LANES); store_edge(e->e2, out + 2 * EDGE * LANES);
}

#if OUTER == 1
// Of the rows and columns that triangles can touch, those rows that no edge excludes.
inline void store_span(const Edges *e, vi mixed, vf left, vf right, vf first, vf last, private int *span)
{
    narrow_rows(e->e0, mixed, &first, &last);
    narrow_rows(e->e1, mixed, &first, &last);
    narrow_rows(e->e2, mixed, &first, &last);
    store_rows(first, last, span);
    VSTORE(TO_VI(left), span + 2 * LANES);
    VSTORE(TO_VI(right), span + 3 * LANES);
}
#endif

// Where triangles lie along either axis: bounds of the error of their sheared corners, and those that are
// neither wholly beside the rays within `extent` columns and rows of the centre nor beyond z_far.
typedef struct { vf noise_x, noise_y, z_lo; vi keep; } Reach;

inline Reach reach_of(const Corners *v, const Bundle *r, float extent, float z_far)
{
    Reach w;
    w.z_lo = min(v->pz, min(v->qz, v->rz));
    const vf z_hi = max(v->pz, max(v->qz, v->rz)), z_most = max(fabs(w.z_lo), fabs(z_hi));
    w.noise_x = corner_noise(v->px, v->qx, v->rx, z_most, r->sx, r->tx, r->dx, r, extent);
    w.noise_y = corner_noise(v->py, v->qy, v->ry, z_most, r->sy, r->ty, r->dy, r, extent);
    w.keep = ~(beside_block(v->px, v->qx, v->rx, w.z_lo, z_hi, w.noise_x, r->sx, r->tx, r, extent) |
               beside_block(v->py, v->qy, v->ry, w.z_lo, z_hi, w.noise_y, r->sy, r->ty, r, extent) | GT(w.z_lo, (vf)(z_far)));
    return w;
}

// Set up the LANES triangles at `leaf` (9 rows of 16); writes coefficients, signed so that n . D > 0
// unless mixed, to `out`, and to `span` what of the block each can touch: first and last row, first and last
// column, or, for blocks of several elements, a bit for each row, and for each column.
inline Cull setup_triangles(const Bundle *r, global const float *leaf, float z_far, private float *out, private int *span)
{
    const Corners v = shear_corners(r, leaf);
    const Reach reach = reach_of(&v, r, HALF, z_far);
    vi keep = reach.keep;
    Cull cull = {0, 0, 0};
    if (!row_any(keep)) return cull;
    Edges e = make_edges(&v, r);
    const Lie lie = lie_of(&e);
    keep &= lie.meets;
    if (!row_any(keep)) return cull;
#if OUTER > 1
    const vi columns = places_reached(v.px, v.qx, v.rx, v.pz, v.qz, v.rz, reach.noise_x, r->sx, r->tx, r);
    const vi rows = places_reached(v.py, v.qy, v.ry, v.pz, v.qz, v.rz, reach.noise_y, r->sy, r->ty, r);
    keep &= ~(EQ(columns, (vi)(0)) | EQ(rows, (vi)(0)));
    VSTORE(rows, span);
    VSTORE(columns, span + LANES);
#else
    vf left, right, first, last;
    span_samples(v.px, v.qx, v.rx, v.pz, v.qz, v.rz, reach.noise_x, r->sx, r->tx, HALF, &left, &right);
    span_samples(v.py, v.qy, v.ry, v.pz, v.qz, v.rz, reach.noise_y, r->sy, r->ty, HALF, &first, &last);
    keep &= LE(left, right) & LE(first, last);
#endif
    cull.keep = row_bits(keep);
    if (!cull.keep) return cull;
    cull.cover = row_bits(keep & lie.covers);
    cull.mixed = row_bits(keep & lie.mixed);
    store_edges(&e, out);
    Affine over, under;
    plane_forms(&v, r, lie.flip, &over, &under);
    store_flat(over, out + 3 * EDGE * LANES);
    store_flat(under, out + (3 * EDGE + FLAT) * LANES);
#if OUTER == 1
    store_span(&e, lie.mixed, left, right, first, last, span);
#endif
    return cull;
}

#endif
