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

// Narrow the rows [first, last] to those where an edge can be non-negative, rounding allowed for:
// e.c + HALF |e.i| + j e.j >= 0.  Uses first, last and mixed of its caller.
#define ROWS(e)                                                                  \
    {                                                                            \
        const vf wide = HALF * fabs(e.i);                                        \
        const vf at = -(e.c + wide + 1.0e-6f * (fabs(e.c) + wide)) / e.j;        \
        const vi up = GT(e.j, (vf)(0.0f)) & ~mixed, down = LT(e.j, (vf)(0.0f)) & ~mixed; \
        first = pick(first, max(first, at), up);                                \
        last = pick(last, min(last, at), down);                                 \
    }

inline void store_rows(vf first, vf last, private int *rows)
{
    VSTORE(TO_VI(ceil(clamp(first, (vf)(-HALF), (vf)(HALF)) + (HALF - 0.01f))), rows);
    VSTORE(TO_VI(floor(clamp(last, (vf)(-HALF), (vf)(HALF)) + (HALF + 0.01f))), rows + LANES);
}

// Triangles whose sheared corners a, b, c lie wholly beside the block along one axis, whichever way they
// face: at depth z the block reaches HALF |s + z t|, convex in z.  Narrows the rows that the triangle can
// touch, unless `first` is null.
inline vi beside_block(vf a, vf b, vf c, vf z_lo, vf z_hi, float s, float t, float d, vf *first, vf *last)
{
    const vf slack = 4.0e-7f * (max(fabs(a), max(fabs(b), fabs(c))) + max(fabs(z_lo), fabs(z_hi)) * fabs(d));
    const vf lo = min(a, min(b, c)) - slack, hi = max(a, max(b, c)) + slack;
    const vf near = fma(z_lo, (vf)(t), (vf)(s)), far = fma(z_hi, (vf)(t), (vf)(s));
    const vf reach = (HALF * 1.00001f) * max(fabs(near), fabs(far));
    if (first) {
        const vf u = lo / near, v = hi / near, w = lo / far, y = hi / far;
        const vi same = GT(near * far, (vf)(0.0f));
        *first = pick(*first, max(*first, min(min(u, v), min(w, y))), same);
        *last = pick(*last, min(*last, max(max(u, v), max(w, y))), same);
    }
    return GT(lo, reach) | LT(hi, -reach);
}

// Set up the LANES triangles at `leaf` (9 rows of 16); writes coefficients, signed so that n . D > 0
// unless mixed, to `out`, and the rows [first, last] of the block that each can touch to `rows`.
inline Cull setup_triangles(const Bundle *r, global const float *leaf, float z_far, private float *out, private int *rows)
{
    const vf pz = VLOAD(leaf + 32), qz = VLOAD(leaf + 80), rz = VLOAD(leaf + 128);
    const vf dx = r->dx, dy = r->dy;
    const vf px = fma(-pz, dx, VLOAD(leaf) - r->ox), py = fma(-pz, dy, VLOAD(leaf + 16) - r->oy);
    const vf qx = fma(-qz, dx, VLOAD(leaf + 48) - r->ox), qy = fma(-qz, dy, VLOAD(leaf + 64) - r->oy);
    const vf rx = fma(-rz, dx, VLOAD(leaf + 96) - r->ox), ry = fma(-rz, dy, VLOAD(leaf + 112) - r->oy);
    const vf z_lo = min(pz, min(qz, rz)), z_hi = max(pz, max(qz, rz));
    vf first = -HALF, last = HALF;
    const vi beside = beside_block(px, qx, rx, z_lo, z_hi, r->sx, r->tx, r->dx, 0, 0) |
                      beside_block(py, qy, ry, z_lo, z_hi, r->sy, r->ty, r->dy, &first, &last);
    Cull cull = {0, 0, 0};
    if (!row_any(~beside)) return cull;
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
    const vi keep = ~(flat | beside | GT(z_lo, (vf)(z_far)) | (outside & ~mixed));
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
    ROWS(e0) ROWS(e1) ROWS(e2)
    store_rows(first, last, rows);
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

inline int hit_triangle(private const float *c, uint lane, int covers, int mixed, int first, int last, int id,
                        global float *z, global int *ids)
{
    const float ac = c[lane], ai = c[LANES + lane], aj = c[2 * LANES + lane];
    const float bc = c[3 * LANES + lane], bi = c[4 * LANES + lane], bj = c[5 * LANES + lane];
    const float cc = c[6 * LANES + lane], ci = c[7 * LANES + lane], cj = c[8 * LANES + lane];
    const float zc = c[9 * LANES + lane], zi = c[10 * LANES + lane], zj = c[11 * LANES + lane];
    const float wc = c[12 * LANES + lane], wi = c[13 * LANES + lane], wj = c[14 * LANES + lane];
    int changed = 0;
    for (int row = first; row <= last; ++row) {
        const float y = row - HALF;
        for (int column = 0; column < BLOCK; column += LANES) {
            const vf x = IOTA + (column - HALF);
            vf a = affine_row(ac, ai, aj, x, y), b = affine_row(bc, bi, bj, x, y), g = affine_row(cc, ci, cj, x, y);
            vf sum = affine_row(wc, wi, wj, x, y), depth = affine_row(zc, zi, zj, x, y);
            vi mask;
            if (covers) mask = (vi)(-1);
            else {
                if (mixed) {
                    const vi sign = AS_VI(sum) & (vi)(0x80000000);
                    FLIP_BY(a, sign); FLIP_BY(b, sign); FLIP_BY(g, sign); FLIP_BY(sum, sign); FLIP_BY(depth, sign);
                }
                mask = GE(min(a, min(b, g)), (vf)(0.0f)) & GT(sum, (vf)(0.0f));
                if (!row_any(mask)) continue;
            }
            depth *= reciprocal(sum);
            changed |= hit_row(depth, mask, id, z + row * BLOCK + column, ids + row * BLOCK + column);
        }
    }
    return changed;
}

#endif
