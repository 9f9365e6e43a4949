// Coverage: the triangles that a block is known to see while others are tested.  Most blocks of a
// dense slab lie wholly on one triangle: such a block keeps it and the two affine functions of its
// depth, and writes no depth buffer until another triangle may be seen, too.
#pragma once
#include "cut_outs.cl"
#include "triangles.cl"

// Depths and triangles; infinity and -1 where no triangle is hit.
typedef struct { float z[BLOCK_RAYS]; int ids[BLOCK_RAYS]; } DepthBuffer;

#define NOTHING -1   // no triangle yet, depth buffer not written
#define BUFFERED -2  // depth buffer in use; any other value: the one triangle that covers the block
typedef struct {
    int covering_triangle;          // NOTHING, BUFFERED or a triangle
    float half_extent;              // of the block's rays
    float z_near, z_far;            // least and greatest depth; z_far is FAR while a ray has no hit
    Affine numerator, denominator;  // of the covering triangle's depth
    global float *z;                // of the depth buffer
    global int *ids;
} Coverage;

inline void clear_coverage(global DepthBuffer *memory, float half_extent, Coverage *c)
{
    *c = (Coverage){NOTHING, half_extent, FAR, FAR, .z = memory->z, .ids = memory->ids};
}

// Write the depth buffer of a block that so far had none.
inline void use_buffer(Coverage *c)
{
    if (c->covering_triangle == BUFFERED) return;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Row row = row_at(at, c->half_extent);
        const vf z = affine_row(c->numerator, row) * reciprocal(affine_row(c->denominator, row));
        VSTORE((vi)(c->covering_triangle), c->ids + at);
        VSTORE(c->covering_triangle == NOTHING ? (vf)(INFINITY) : z, c->z + at);
    }
    c->covering_triangle = BUFFERED;
}

// Whether corner values are positive and within a factor of two: errors are in proportion to each.
inline int are_even(float4 a) { return least_of(a) > 0.0f && most_of(a) <= 2.0f * least_of(a); }

// Least and most depth over a rectangle; (0, 0) where rounding errors may be large.
inline float2 depth_range(Affine numerator, Affine denominator, Rectangle grid)
{
    const int even = are_even(corner_values(numerator, grid)) &&
                     are_even(corner_values(denominator, grid));
    const float2 slack = (float2)(1.0f - DEPTH_SLACK, 1.0f + DEPTH_SLACK);
    return even ? slack * quotient_range(numerator, denominator, grid) : 0.0f;
}

// Accept or reject at once a triangle that every ray of a block of one element passes through;
// false if its range of depths and that of the block's hits overlap.
inline int try_full_cover(const Triangles *t, uint lane, int id, Coverage *c)
{
    if (OUTER > 1 || c->covering_triangle == BUFFERED) return 0;
    const Affine numerator = affine_of(t->functions + NUMERATOR, lane);
    const Affine denominator = affine_of(t->functions + DENOMINATOR, lane);
    const Rectangle grid = {0.0f, 0.0f, c->half_extent, c->half_extent};
    const float2 z = depth_range(numerator, denominator, grid);
    if (!(z.x > 0.0f)) return 0;
    if (z.x > c->z_far) return 1;
    if (!(z.y < c->z_near)) return 0;
    c->covering_triangle = id;
    c->z_near = z.x;
    c->z_far = z.y;
    c->numerator = numerator;
    c->denominator = denominator;
    return 1;
}

// Whether depth `z` of triangle `id` is nearer than what is there; of equal depths the lower number
// wins.  The unsigned comparison of float bits rejects negative depths and NaN, too.
inline vi is_nearer(vf z, int id, vf old_z, vi old_id)
{
    const vu new = AS_VU(z), old = AS_VU(old_z);
    return LT(new, old) | (EQ(new, old) & LT((vi)(id), old_id));
}

// Mask of a row of rays that hit a triangle, and its depth; `e` are its affine functions.  Those of
// a triangle seen edge-on get their signs and errors here.
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
            const vf base = AT_OFFSETS(at.x, at.u, g.of[ONE], g.of[Y], g.of[V]);
            vf inner = g.of[X], outer = g.of[U];
            if (OUTER > 1 && k < NUMERATOR) {
                inner = fma(-at.u, (vf)(g.of[BILINEAR]), inner);
                outer = fma(at.x, (vf)(g.of[BILINEAR]), outer);
            }
            VSTORE(base, f->base[k] + first);
            VSTORE(inner, f->inner[k] + first);
            if (OUTER > 1) VSTORE(outer, f->outer[k] + first);
        }
    }
}

// Merge one of LANES triangles into the depth buffer; returns whether anything changed.
inline int hit_triangle(const Triangles *t, uint lane, int id, const Bundle *bundle,
                        const CutOuts *cut_outs, const Coverage *to)
{
    const int holes = has_holes(cut_outs, id);
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
                mask = mask_of_bits(stopped_rays(cut_outs, id, bundle, at, depth, bits));
            }
            if (!row_any(mask)) continue;
            VSTORE(pick(old_z, depth, mask), z);
            VSTORE(pick_int(old_id, (vi)(id), mask), ids);
            changed = 1;
        }
    }
    return changed;
}
