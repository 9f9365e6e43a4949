// The depth buffer of a block: the nearest triangle and its depth per ray.
#pragma once
#include "alpha_test.cl"
#include "triangles.cl"

// Depths and triangles; infinity and -1 where no triangle is hit.
typedef struct { float z[BLOCK_RAYS]; int ids[BLOCK_RAYS]; } DepthBuffer;

typedef struct {
    float z_far;    // greatest depth; FAR while a ray has no hit
    global float *z;  // of the depth buffer
    global int *ids;
} Coverage;

inline void clear_coverage(global DepthBuffer *memory, Coverage *c)
{
    *c = (Coverage){.z_far = FAR, .z = memory->z, .ids = memory->ids};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        VSTORE((vf)(INFINITY), c->z + at);
        VSTORE((vi)(-1), c->ids + at);
    }
}

// Whether depth `z` of triangle `id` is nearer than the old depth; at equal depth the lower number
// wins.  The unsigned comparison of float bits rejects negative depths and NaN, too.
inline vi is_nearer(vf z, int id, vf old_z, vi old_id)
{
    const vu new = AS_VU(z), old = AS_VU(old_z);
    return LT(new, old) | (EQ(new, old) & LT((vi)(id), old_id));
}

// Mask of a row of rays that hit a triangle, and its depth; `e` are its affine functions.  For a
// triangle seen edge-on, signs and error bounds are applied here.
inline vi hit_rays(const Triangles *t, uint lane, vf *e, vf *depth)
{
    *depth = e[NUMERATOR] * reciprocal(e[DENOMINATOR]);
    if (t->edge_on >> lane & 1) {
        const vi sign = sign_of(e[DENOMINATOR]);
        for (int k = 0; k < FUNCTIONS; ++k) e[k] = flip_sign(e[k], sign);
        *depth = clamp(*depth, (vf)(t->near[lane]), (vf)(t->far[lane]));
    }
    return GE(min(e[0], min(e[1], e[2])), (vf)(-t->slack[lane])) & GT(e[DENOMINATOR], (vf)(0.0f));
}

// A triangle's functions along each of the block's rows: base + x inner + u outer.
typedef struct {
    float base[FUNCTIONS][BLOCK], inner[FUNCTIONS][BLOCK], outer[FUNCTIONS][BLOCK];
} TriangleRows;

inline void make_rows(const Triangles *t, uint lane, float half_extent, TriangleRows *f)
{
    for (int first = 0; first < BLOCK; first += LANES) {
        if (!(t->rows[lane] >> first & ((1 << LANES) - 1))) continue;
        // The grid is square: x and u serve as offsets along y and v, too.
        const Row at = row_at(first, half_extent);
        for (int k = 0; k < FUNCTIONS; ++k) {
            const Affine g = affine_of(t->functions + k, lane);
            const vf base = AT_OFFSETS(at.x, at.u, g.term[ONE], g.term[Y], g.term[V]);
            vf inner = g.term[X], outer = g.term[U];
            if (OUTER > 1 && k < NUMERATOR) {
                inner = fma(-at.u, (vf)(g.term[BILINEAR]), inner);
                outer = fma(at.x, (vf)(g.term[BILINEAR]), outer);
            }
            VSTORE(base, f->base[k] + first);
            VSTORE(inner, f->inner[k] + first);
            if (OUTER > 1) VSTORE(outer, f->outer[k] + first);
        }
    }
}

// Merge one of LANES triangles into the depth buffer; returns whether anything changed.
inline int hit_triangle(const Triangles *t, uint lane, int id, const Bundle *bundle,
                        const AlphaTests *alpha_tests, const Coverage *to)
{
    const int holes = has_holes(alpha_tests, id);
    TriangleRows f;
    make_rows(t, lane, bundle->half_extent, &f);
    int changed = 0;
    for (uint rows = t->rows[lane]; rows; rows &= rows - 1) {
        const int row = lowest(rows);
        for (int column = 0; column < BLOCK; column += LANES) {
            if (!(t->columns[lane] >> column & ((1 << LANES) - 1))) continue;
            const Row at = row_at(row * BLOCK + column, bundle->half_extent);
            vf e[FUNCTIONS], depth;
            for (int k = 0; k < FUNCTIONS; ++k)
                e[k] = AT_OFFSETS(at.x, at.u, f.base[k][row], f.inner[k][row], f.outer[k][row]);
            vi mask = hit_rays(t, lane, e, &depth);
            global float *z = to->z + row * BLOCK + column;
            global int *ids = to->ids + row * BLOCK + column;
            const vf old_z = VLOAD(z);
            const vi old_id = VLOAD(ids);
            mask &= is_nearer(depth, id, old_z, old_id);
            if (holes) {
                const uint bits = row_bits(mask);
                mask = mask_of_bits(stopped_rays(alpha_tests, id, bundle, at, depth, bits));
            }
            if (!row_any(mask)) continue;
            VSTORE(pick(old_z, depth, mask), z);
            VSTORE(pick_int(old_id, (vi)(id), mask), ids);
            changed = 1;
        }
    }
    return changed;
}
