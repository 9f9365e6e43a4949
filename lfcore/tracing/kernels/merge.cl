// One triangle against the depth buffer of a block, row by row.
#ifndef LFCORE_MERGE_CL
#define LFCORE_MERGE_CL
#include "triangles.cl"

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

// Weights a, b, g of a row of rays, their sum and the numerator of depth: which rays the triangle meets,
// and how far.
inline vi meet(vf a, vf b, vf g, vf sum, vf z, int covers, int mixed, vf *depth)
{
    if (mixed) {
        const vi sign = AS_VI(sum) & (vi)(0x80000000);
        FLIP_BY(a, sign); FLIP_BY(b, sign); FLIP_BY(g, sign); FLIP_BY(sum, sign); FLIP_BY(z, sign);
    }
    *depth = z * reciprocal(sum);
    return covers ? (vi)(-1) : GE(min(a, min(b, g)), (vf)(0.0f)) & GT(sum, (vf)(0.0f));
}

#if OUTER > 1

// Forms of one triangle along each of the block's rows: base + x along + u across.
typedef struct {
    float base[5][BLOCK], along[3][BLOCK], across[3][BLOCK];  // three edges; numerator and denominator of depth
    float x[2], u[2];                                         // of those two, the same in all rows
} RowForms;

// Returns the rows in which no edge excludes every ray, rounding allowed for.
inline uint make_row_forms(private const float *c, uint lane, uint wanted, RowForms *forms)
{
    uint rows = 0;
    for (int first = 0; first < BLOCK; first += LANES) {
        if (!(wanted >> first & ((1u << LANES) - 1u))) continue;
        const Row at = row_at(first);  // the places of rows along y are those of columns along x
        vi meets = -1;
        for (int k = 0; k < 3; ++k) {
            private const float *e = c + k * EDGE * LANES + lane;
            const vf base = fma(at.u, (vf)(e[4 * LANES]), fma(at.x, (vf)(e[2 * LANES]), (vf)(e[0])));
            const vf along = fma(-at.u, (vf)(e[5 * LANES]), (vf)(e[LANES])), across = fma(at.x, (vf)(e[5 * LANES]), (vf)(e[3 * LANES]));
            VSTORE(base, forms->base[k] + first);
            VSTORE(along, forms->along[k] + first);
            VSTORE(across, forms->across[k] + first);
            const vf reach = fma(fabs(along), (vf)(HALF), fabs(across) * OUTER_HALF);
            meets &= GE(fma(reach + fabs(base), (vf)(1.0e-6f), base + reach), (vf)(0.0f));
        }
        rows |= row_bits(meets) << first;
        for (int k = 0; k < 2; ++k) {
            private const float *f = c + (3 * EDGE + k * FLAT) * LANES + lane;
            VSTORE(fma(at.u, (vf)(f[4 * LANES]), fma(at.x, (vf)(f[2 * LANES]), (vf)(f[0]))), forms->base[3 + k] + first);
        }
    }
    for (int k = 0; k < 2; ++k) {
        forms->x[k] = c[(3 * EDGE + k * FLAT + 1) * LANES + lane];
        forms->u[k] = c[(3 * EDGE + k * FLAT + 3) * LANES + lane];
    }
    return rows;
}

// A triangle that can touch no more than LANES rays, those where `rows` and `columns` cross: all of them at once.
inline int hit_few(private const float *c, uint lane, int covers, int mixed, uint rows, uint columns, int id, global float *z,
                   global int *ids)
{
    private int place[LANES];
    private float found[LANES];
    int count = 0;
    for (int k = 0; k < LANES; ++k) place[k] = 0;
    for (; rows; rows &= rows - 1)
        for (uint rest = columns; rest; rest &= rest - 1) place[count++] = lowest(rows) * BLOCK + lowest(rest);
    const vi at = VLOAD(place), column = at & (BLOCK - 1), row = at / BLOCK;
    const vf x = TO_VF(column & (INNER - 1)) - HALF, u = TO_VF(column / INNER) - OUTER_HALF;
    const vf y = TO_VF(row & (INNER - 1)) - HALF, v = TO_VF(row / INNER) - OUTER_HALF;
    vf e[3], flat[2], depth;
    c += lane;
#define AT(n) (vf)(c[(n) * LANES])
    for (int k = 0; k < 3; ++k) {
        const int n = k * EDGE;
        const vf base = fma(v, AT(n + 4), fma(y, AT(n + 2), AT(n)));
        e[k] = fma(u, fma(y, AT(n + 5), AT(n + 3)), fma(x, fma(-v, AT(n + 5), AT(n + 1)), base));
    }
    for (int k = 0; k < 2; ++k) {
        const int n = 3 * EDGE + k * FLAT;
        flat[k] = fma(u, AT(n + 3), fma(x, AT(n + 1), fma(v, AT(n + 4), fma(y, AT(n + 2), AT(n)))));
    }
#undef AT
    const vi mask = meet(e[0], e[1], e[2], flat[1], flat[0], covers, mixed, &depth);
    int changed = 0;
    VSTORE(depth, found);
    for (uint bits = row_bits(mask) & ((1u << count) - 1u); bits; bits &= bits - 1) {
        const uint k = lowest(bits);
        const int to = place[k], old_id = ids[to];
        const uint new = as_uint(found[k]), old = as_uint(z[to]);
        const int nearer = (new < old) | ((new == old) & (id < old_id));
        z[to] = as_float(nearer ? new : old);
        ids[to] = nearer ? id : old_id;
        changed |= nearer;
    }
    return changed;
}

// `span`: a bit for each row, and for each column, that the triangle can touch.
inline int hit_triangle(private const float *c, uint lane, int covers, int mixed, private const int *span, int id, global float *z,
                        global int *ids)
{
    uint rows = span[lane];
    const uint columns = span[LANES + lane];
    if (popcount(rows) * popcount(columns) <= LANES) return hit_few(c, lane, covers, mixed, rows, columns, id, z, ids);
    RowForms f;
    const uint open = make_row_forms(c, lane, rows, &f);
    if (!mixed) rows &= open;
    int changed = 0;
    for (; rows; rows &= rows - 1) {
        const int row = lowest(rows);
        for (int column = 0; column < BLOCK; column += LANES) {
            if (!(columns >> column & ((1u << LANES) - 1u))) continue;
            const Row place = row_at(column);
#define ALONG(k) fma(place.u, (vf)(f.across[k][row]), fma(place.x, (vf)(f.along[k][row]), (vf)(f.base[k][row])))
#define DEPTH(k) fma(place.u, (vf)(f.u[k]), fma(place.x, (vf)(f.x[k]), (vf)(f.base[3 + k][row])))
            vf depth;
            const vi mask = meet(ALONG(0), ALONG(1), ALONG(2), DEPTH(1), DEPTH(0), covers, mixed, &depth);
#undef ALONG
#undef DEPTH
            if (!row_any(mask)) continue;
            changed |= hit_row(depth, mask, id, z + row * BLOCK + column, ids + row * BLOCK + column);
        }
    }
    return changed;
}

#else

// A triangle over a row of rays.
inline vi meet_row(private const float *c, uint lane, int covers, int mixed, vf x, vf y, vf *depth)
{
#define AFFINE(k) fma(x, (vf)(c[(k + 1) * LANES + lane]), fma(y, (vf)(c[(k + 2) * LANES + lane]), (vf)(c[k * LANES + lane])))
    return meet(AFFINE(0), AFFINE(3), AFFINE(6), AFFINE(12), AFFINE(9), covers, mixed, depth);
#undef AFFINE
}

// `span`: first and last row, first and last column that the triangle can touch.
inline int hit_triangle(private const float *c, uint lane, int covers, int mixed, private const int *span, int id, global float *z,
                        global int *ids)
{
    const int first = span[lane], last = span[LANES + lane];
    int changed = 0;
    vf depth;
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

#endif
