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

// Coefficients of LANES triangles: constant, i and j part of the edges opposite p, q, r and of the
// numerator and denominator of depth; 15 rows.
#define COEFFICIENTS 15

typedef struct { vf c, i, j; } Affine;

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
    return e;
}

// Bound of the rounding error of such a form anywhere in the block: sum, difference, product and their
// difference are four roundings of each term, its evaluation at a ray two more.
inline vf edge_noise(vf px, vf py, vf pz, vf qx, vf qy, vf qz, const Bundle *r)
{
    const vf sx = fabs(px + qx), sy = fabs(py + qy), sz = fabs(pz + qz), dx = fabs(qx - px), dy = fabs(qy - py), dz = fabs(qz - pz);
    const vf wide = fma(fma(sy, dz, sz * dy), (vf)(fabs(r->tx)), 2.0f * dy * fabs(r->sx)) +
                    fma(fma(sz, dx, sx * dz), (vf)(fabs(r->ty)), 2.0f * dx * fabs(r->sy));
    return 3.6e-7f * fma((vf)(HALF), wide, fma(sx, dy, sy * dx));
}

inline vf spread(Affine e) { return HALF * (fabs(e.i) + fabs(e.j)); }

typedef struct {
    uint keep;     // lanes that may be hit
    uint cover;    // of those, lanes that every ray of the block is inside of
    uint mixed;    // lanes seen edge-on by some ray: the sign of n . D changes within the block
} Cull;

// Triangles whose sheared corners a, b, c lie wholly beside the block along one axis, whichever way they
// face: at depth z the block reaches HALF |s + z t|, convex in z.
inline vi beside_block(vf a, vf b, vf c, vf z_lo, vf z_hi, vf z_most, float s, float t, float d)
{
    const vf near = fma(z_lo, (vf)(t), (vf)(s)), far = fma(z_hi, (vf)(t), (vf)(s));
    const vf noise = 4.0e-7f * (max(fabs(a), max(fabs(b), fabs(c))) + fma(z_most, (vf)(fabs(d) + HALF * fabs(t)), (vf)(HALF * fabs(s))));
    const vf reach = fma((vf)(HALF * 1.00001f), max(fabs(near), fabs(far)), noise);
    return GT(min(a, min(b, c)), reach) | LT(max(a, max(b, c)), -reach);
}

// Samples [first, last] along one axis of the block, from 0 to 2 HALF, that triangles of sheared corners a, b,
// c can reach.  At depth z neighbouring rays are s + z t apart; while that keeps its sign over the triangle,
// the extremes are its corners' (a projective map), and what falls between two samples is found out.
inline void span_samples(vf a, vf b, vf c, vf az, vf bz, vf cz, vf z_most, float s, float t, float d, vf *first, vf *last)
{
    const vf wa = fma(az, (vf)(t), (vf)(s)), wb = fma(bz, (vf)(t), (vf)(s)), wc = fma(cz, (vf)(t), (vf)(s));
    const vf ra = native_recip(wa), rb = native_recip(wb), rc = native_recip(wc);
    const vf ia = a * ra, ib = b * rb, ic = c * rc;
    const vf noise = 4.0e-7f * (max(fabs(a), max(fabs(b), fabs(c))) + fma(z_most, (vf)(fabs(d) + HALF * fabs(t)), (vf)(HALF * fabs(s))));
    const vf slack = fma(noise, max(fabs(ra), max(fabs(rb), fabs(rc))), (vf)(0.01f));
    const vi same = GT(wa * wb, (vf)(0.0f)) & GT(wb * wc, (vf)(0.0f));
    const vf lo = ceil(min(ia, min(ib, ic)) - slack + HALF), hi = floor(max(ia, max(ib, ic)) + slack + HALF);
    *first = max(pick((vf)(0.0f), lo, same), (vf)(0.0f));
    *last = min(pick((vf)(2.0f * HALF), hi, same), (vf)(2.0f * HALF));
}

// Of the rows [first, last], counted from 0, those where a form can be non-negative, rounding allowed for:
// e.c + HALF |e.i| + (row - HALF) e.j >= 0.
inline void narrow_rows(Affine e, vi mixed, vf *first, vf *last)
{
    const vf wide = HALF * fabs(e.i);
    const vf at = -(e.c + wide + 1.0e-6f * (fabs(e.c) + wide)) * native_recip(e.j);
    *first = pick(*first, max(*first, ceil(at + (HALF - 0.01f))), GT(e.j, (vf)(1.0e-30f)) & ~mixed);
    *last = pick(*last, min(*last, floor(at + (HALF + 0.01f))), LT(e.j, (vf)(-1.0e-30f)) & ~mixed);
}

// No row at all where first is beyond last.
inline void store_rows(vf first, vf last, private int *rows)
{
    VSTORE(clamp(TO_VI(first), (vi)(0), (vi)(BLOCK)), rows);
    VSTORE(clamp(TO_VI(last), (vi)(-1), (vi)(BLOCK - 1)), rows + LANES);
}

// Set up the LANES triangles at `leaf` (9 rows of 16); writes coefficients, signed so that n . D > 0
// unless mixed, to `out`, and to `span` the first and last row, first and last column of
// the block that each can touch.
inline Cull setup_triangles(const Bundle *r, global const float *leaf, float z_far, private float *out, private int *span)
{
    const vf pz = VLOAD(leaf + 32), qz = VLOAD(leaf + 80), rz = VLOAD(leaf + 128);
    const vf dx = r->dx, dy = r->dy;
    const vf px = fma(-pz, dx, VLOAD(leaf) - r->ox), py = fma(-pz, dy, VLOAD(leaf + 16) - r->oy);
    const vf qx = fma(-qz, dx, VLOAD(leaf + 48) - r->ox), qy = fma(-qz, dy, VLOAD(leaf + 64) - r->oy);
    const vf rx = fma(-rz, dx, VLOAD(leaf + 96) - r->ox), ry = fma(-rz, dy, VLOAD(leaf + 112) - r->oy);
    const vf z_lo = min(pz, min(qz, rz)), z_hi = max(pz, max(qz, rz)), z_most = max(fabs(z_lo), fabs(z_hi));
    vi keep = ~(beside_block(px, qx, rx, z_lo, z_hi, z_most, r->sx, r->tx, r->dx) |
                beside_block(py, qy, ry, z_lo, z_hi, z_most, r->sy, r->ty, r->dy) | GT(z_lo, (vf)(z_far)));
    Cull cull = {0, 0, 0};
    if (!row_any(keep)) return cull;
    Affine e0 = edge(qx, qy, qz, rx, ry, rz, r);
    Affine e1 = edge(rx, ry, rz, px, py, pz, r);
    Affine e2 = edge(px, py, pz, qx, qy, qz, r);
    const Affine n = {e0.c + e1.c + e2.c, e0.i + e1.i + e2.i, e0.j + e1.j + e2.j};
    const vf w = spread(n);
    const vi flat = EQ(n.c, (vf)(0.0f)) & EQ(w, (vf)(0.0f));
    const vi mixed = LE(fabs(n.c), w * 1.00001f);
    // One sign for the whole block: flip the triangles seen from behind.
    const vi flip = LT(n.c, (vf)(0.0f)) & ~mixed & (vi)(0x80000000);
#define FLIP(a) a = AS_VF(AS_VI(a) ^ flip)
    FLIP(e0.c); FLIP(e0.i); FLIP(e0.j); FLIP(e1.c); FLIP(e1.i); FLIP(e1.j); FLIP(e2.c); FLIP(e2.i); FLIP(e2.j);
    e0.c += pick((vf)(0.0f), edge_noise(qx, qy, qz, rx, ry, rz, r), ~mixed);
    e1.c += pick((vf)(0.0f), edge_noise(rx, ry, rz, px, py, pz, r), ~mixed);
    e2.c += pick((vf)(0.0f), edge_noise(px, py, pz, qx, qy, qz, r), ~mixed);
    // A rounding error of the evaluation at a ray must not be culled away: a little slack.
    const vf slack = 1.00001f;
    const vf w0 = spread(e0) * slack, w1 = spread(e1) * slack, w2 = spread(e2) * slack;
    const vf tiny = 1.0e-30f;
    const vi outside = LT(e0.c + w0, -tiny) | LT(e1.c + w1, -tiny) | LT(e2.c + w2, -tiny);
    const vi inside = GE(e0.c, w0 + tiny) & GE(e1.c, w1 + tiny) & GE(e2.c, w2 + tiny);
    keep &= ~(flat | (outside & ~mixed));
    if (!row_any(keep)) return cull;
    vf left, right, first, last;
    span_samples(px, qx, rx, pz, qz, rz, z_most, r->sx, r->tx, r->dx, &left, &right);
    span_samples(py, qy, ry, pz, qz, rz, z_most, r->sy, r->ty, r->dy, &first, &last);
    keep &= LE(left, right) & LE(first, last);
    cull.keep = row_bits(keep);
    if (!cull.keep) return cull;
    cull.cover = row_bits(keep & inside & ~mixed);
    cull.mixed = row_bits(keep & mixed);
    VSTORE(e0.c, out); VSTORE(e0.i, out + LANES); VSTORE(e0.j, out + 2 * LANES);
    VSTORE(e1.c, out + 3 * LANES); VSTORE(e1.i, out + 4 * LANES); VSTORE(e1.j, out + 5 * LANES);
    VSTORE(e2.c, out + 6 * LANES); VSTORE(e2.i, out + 7 * LANES); VSTORE(e2.j, out + 8 * LANES);
    // Depth from the plane n . X = n . P: n is made of edges, so its error scales with the triangle
    // and not with its distance, as that of the weights does.
    const vf ax = qx - px, ay = qy - py, az = qz - pz, bx = rx - px, by = ry - py, bz = rz - pz;
    vf nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
    FLIP(nx); FLIP(ny); FLIP(nz);
    VSTORE(fma(nx, px, fma(ny, py, nz * pz)), out + 9 * LANES);
    VSTORE(-nx * r->sx, out + 10 * LANES); VSTORE(-ny * r->sy, out + 11 * LANES);
    VSTORE(nz, out + 12 * LANES); VSTORE(nx * r->tx, out + 13 * LANES); VSTORE(ny * r->ty, out + 14 * LANES);
    narrow_rows(e0, mixed, &first, &last);
    narrow_rows(e1, mixed, &first, &last);
    narrow_rows(e2, mixed, &first, &last);
    store_rows(first, last, span);
    VSTORE(TO_VI(left), span + 2 * LANES);
    VSTORE(TO_VI(right), span + 3 * LANES);
    return cull;
}

#define FLIP_BY(a, sign) a = AS_VF(AS_VI(a) ^ (sign))

inline vf affine_row(float c, float i, float j, vf x, float y) { return fma(x, (vf)(i), (vf)(fma(y, j, c))); }

// Merge one triangle into the block's depth buffer.  The unsigned comparison of float bits rejects
// negative depths and NaN along with farther hits; equal depths go to the lower triangle index.
inline int hit_row(vf depth, vi mask, int id, global float *z, global int *ids)
{
    const vu bits = AS_VU(depth), old = AS_VU(VLOAD(z));
    const vi old_id = VLOAD(ids);
    mask &= LT(bits, old) | (EQ(bits, old) & LT((vi)(id), old_id));
    if (!row_any(mask)) return 0;
    VSTORE(pick(AS_VF(old), depth, mask), z);
    VSTORE(pick_int(old_id, (vi)(id), mask), ids);
    return 1;
}

// A row made of 4 x 4 samples, for triangles that reach no farther.
#if LANES == 16
#define WINDOW 4
#define WINDOW_X ((vf)(0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3))
#define WINDOW_Y ((vf)(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3))
#define LOAD_WINDOW(type, p) ((type)(vload4(0, p), vload4(0, (p) + BLOCK), vload4(0, (p) + 2 * BLOCK), vload4(0, (p) + 3 * BLOCK)))
#define STORE_WINDOW(x, p)                    \
    {                                         \
        vstore4(x.s0123, 0, p);               \
        vstore4(x.s4567, 0, (p) + BLOCK);     \
        vstore4(x.s89ab, 0, (p) + 2 * BLOCK); \
        vstore4(x.scdef, 0, (p) + 3 * BLOCK); \
    }
#endif

// A triangle over a row of rays: which of them it meets, and how far.
inline vi meet_row(private const float *c, uint lane, int covers, int mixed, vf x, vf y, vf *depth)
{
#define AFFINE(k) fma(x, (vf)(c[(k + 1) * LANES + lane]), fma(y, (vf)(c[(k + 2) * LANES + lane]), (vf)(c[k * LANES + lane])))
    vf a = AFFINE(0), b = AFFINE(3), g = AFFINE(6), sum = AFFINE(12), z = AFFINE(9);
    if (mixed) {
        const vi sign = AS_VI(sum) & (vi)(0x80000000);
        FLIP_BY(a, sign); FLIP_BY(b, sign); FLIP_BY(g, sign); FLIP_BY(sum, sign); FLIP_BY(z, sign);
    }
    *depth = z * reciprocal(sum);
    return covers ? (vi)(-1) : GE(min(a, min(b, g)), (vf)(0.0f)) & GT(sum, (vf)(0.0f));
#undef AFFINE
}

// `span`: first and last row, first and last column that the triangle can touch.
inline int hit_triangle(private const float *c, uint lane, int covers, int mixed, private const int *span, int id,
                        global float *z, global int *ids)
{
    const int first = span[lane], last = span[LANES + lane];
    int changed = 0;
    vf depth;
#ifdef WINDOW
    const int left = min(span[2 * LANES + lane], BLOCK - WINDOW), top = min(first, BLOCK - WINDOW);
    if (last - top < WINDOW && span[3 * LANES + lane] - left < WINDOW) {
        const vi mask = meet_row(c, lane, covers, mixed, WINDOW_X + (left - HALF), WINDOW_Y + (top - HALF), &depth);
        z += top * BLOCK + left;
        ids += top * BLOCK + left;
        const vf old = LOAD_WINDOW(vf, z);
        const vi old_id = LOAD_WINDOW(vi, ids);
        const vi nearer = mask & (LT(AS_VU(depth), AS_VU(old)) | (EQ(AS_VU(depth), AS_VU(old)) & LT((vi)(id), old_id)));
        if (!row_any(nearer)) return 0;
        const vf new_z = pick(old, depth, nearer);
        const vi new_id = pick_int(old_id, (vi)(id), nearer);
        STORE_WINDOW(new_z, z)
        STORE_WINDOW(new_id, ids)
        return 1;
    }
#endif
    for (int row = first; row <= last; ++row) {
        for (int column = 0; column < BLOCK; column += LANES) {
            const vi mask = meet_row(c, lane, covers, mixed, IOTA + (column - HALF), (vf)(row - HALF), &depth);
            if (!row_any(mask)) continue;
            changed |= hit_row(depth, mask, id, z + row * BLOCK + column, ids + row * BLOCK + column);
        }
    }
    return changed;
}

#endif
