// What a block is known to see while its triangles are tested: coverage.
//
// Most blocks of a dense slab lie wholly on one triangle.  Such a block keeps the triangle and the
// two forms of its depth, and writes no depth buffer until another triangle may be seen, too.
#ifndef LFCORE_DEPTH_BUFFER_CL
#define LFCORE_DEPTH_BUFFER_CL
#include "triangles.cl"

#define NOTHING -1   // no triangle yet, depth buffer not written
#define BUFFERED -2  // depth buffer in use; any other value: the one triangle that covers the block
typedef struct {
    int cover;                    // NOTHING, BUFFERED or a triangle
    // Depth range of what is seen; z_far is FAR while a ray sees nothing.
    float z_near, z_far;
    Form numerator, denominator;  // of the covering triangle's depth
    global float *z;              // (BLOCK_RAYS,) depth buffer; infinity where nothing is met
    global int *ids;              // (BLOCK_RAYS,) its triangles; -1 where nothing is met
} Coverage;

#define COVERAGE_WORDS (2 * BLOCK_RAYS)

inline void clear_coverage(global uint *memory, Coverage *c)
{
    c->cover = NOTHING;
    c->z_near = c->z_far = FAR;
    c->z = (global float *)memory;
    c->ids = (global int *)memory + BLOCK_RAYS;
}

// Write the depth buffer of a block that so far had none.
inline void use_buffer(Coverage *c)
{
    if (c->cover == BUFFERED) return;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vf depth = quotient_row(c->numerator, c->denominator, row_at(at));
        VSTORE((vi)(c->cover), c->ids + at);
        VSTORE(c->cover == NOTHING ? (vf)(INFINITY) : depth, c->z + at);
    }
    c->cover = BUFFERED;
}

inline void find_farthest(Coverage *c)
{
    vf far = VLOAD(c->z);
    for (int at = LANES; at < BLOCK_RAYS; at += LANES) far = max(far, VLOAD(c->z + at));
    c->z_far = min(row_max(far), FAR);
}

// Depths between which a block sees anything; the second is less than the first if it sees nothing.
inline float2 seen_depths(const Coverage *c)
{
    if (c->cover == NOTHING) return (float2)(FAR, -FAR);
    if (c->cover != BUFFERED) return (float2)(c->z_near, c->z_far);
    vf low = FAR, high = 0.0f;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vf depth = VLOAD(c->z + at);
        low = min(low, depth);
        high = pick(high, max(high, depth), GE(VLOAD(c->ids + at), (vi)(0)));
    }
    return (float2)(row_min(low), row_max(high));
}

// Depths at the inner grid's corners, of the element at corner `outer` of the block's elements.
inline float4 corner_depths(Form numerator, Form denominator, int outer)
{
    const Rectangle all = {0.0f, 0.0f, HALF, HALF};
    if (OUTER > 1) {
        const float u = outer & 1 ? OUTER_HALF : -OUTER_HALF;
        const float v = outer & 2 ? OUTER_HALF : -OUTER_HALF;
        numerator.of[ONE] = fma(u, numerator.of[U], fma(v, numerator.of[V], numerator.of[ONE]));
        denominator.of[ONE] = fma(u, denominator.of[U],
                                  fma(v, denominator.of[V], denominator.of[ONE]));
    }
    return corner_values(numerator, all) / corner_values(denominator, all);
}

// Sixteen roundings: a depth at a corner, and that of a ray beside it, are off by a few each.
#define DEPTH_SLACK (17.0f * ROUNDING)

// A triangle that every ray of the block passes through: accept it or reject it at once, if its
// range of depths and that of what is seen do not overlap; false if they do.  Depth is linear-
// fractional with a denominator of one sign, so its extremes are at the corners.
inline int settle_cover(const Triangles *t, uint lane, int id, Coverage *c)
{
    if (c->cover == BUFFERED) return 0;
    const Form numerator = form_of(&t->over, lane), denominator = form_of(&t->under, lane);
    float least = FAR, most = -FAR;
    for (int k = 0; k < (OUTER > 1 ? 4 : 1); ++k) {
        const float4 z = corner_depths(numerator, denominator, k);
        least = min(least, least_of(z));
        most = max(most, most_of(z));
    }
    const float near = least * (1.0f - DEPTH_SLACK), far = most * (1.0f + DEPTH_SLACK);
    if (!(near > 0.0f)) return 0;
    if (near > c->z_far) return 1;
    if (!(far < c->z_near)) return 0;
    c->cover = id;
    c->z_near = near;
    c->z_far = far;
    c->numerator = numerator;
    c->denominator = denominator;
    return 1;
}

// Whether depth `z` of triangle `id` is nearer than what is there.  The unsigned comparison of
// float bits rejects negative depths and NaN along with farther hits; of equal depths the lower
// number wins.
inline vi is_nearer(vf z, int id, vf old_z, vi old_id)
{
    const vu new = AS_VU(z), old = AS_VU(old_z);
    return LT(new, old) | (EQ(new, old) & LT((vi)(id), old_id));
}

// Which of a row of rays a triangle meets, of edges e, the numerator and denominator of depth.
inline vi meet(vf e0, vf e1, vf e2, vf over, vf under, int covers, int edge_on, vf *depth)
{
    if (edge_on) {
        const vi sign = AS_VI(under) & (vi)(0x80000000);
        e0 = flip_sign(e0, sign);
        e1 = flip_sign(e1, sign);
        e2 = flip_sign(e2, sign);
        under = flip_sign(under, sign);
        over = flip_sign(over, sign);
    }
    *depth = over * reciprocal(under);
    if (covers) return -1;
    return GE(min(e0, min(e1, e2)), (vf)(0.0f)) & GT(under, (vf)(0.0f));
}

// Forms of one triangle along each of the block's rows: base + x along + u across.
typedef struct {
    float base[5][BLOCK];                       // three edges, numerator and denominator
    float along[3][BLOCK], across[3][BLOCK];    // of the edges
    float x[2], u[2];                           // of the other two, the same in all rows
} RowForms;

// Returns the rows in which no edge excludes every ray, rounding allowed for.
inline uint make_row_forms(const Triangles *t, uint lane, uint wanted, RowForms *f)
{
    uint rows = 0;
    for (int first = 0; first < BLOCK; first += LANES) {
        if (!(wanted >> first & ((1u << LANES) - 1u))) continue;
        const Row at = row_at(first);  // the places of rows along y are those of columns along x
        vi meets = -1;
        for (int k = 0; k < 3; ++k) {
            const Form e = form_of(t->edge + k, lane);
            vf base = fma(at.x, (vf)(e.of[Y]), (vf)(e.of[ONE])), along = e.of[X];
            vf most = fabs(along) * HALF;
            if (OUTER > 1) {
                base = fma(at.u, (vf)(e.of[V]), base);
                along = fma(-at.u, (vf)(e.of[TWIST]), along);
                const vf across = fma(at.x, (vf)(e.of[TWIST]), (vf)(e.of[U]));
                VSTORE(across, f->across[k] + first);
                most = fma(fabs(along), (vf)(HALF), fabs(across) * OUTER_HALF);
            }
            VSTORE(base, f->base[k] + first);
            VSTORE(along, f->along[k] + first);
            const vf slack = FRUSTUM_SLACK * (most + fabs(base));
            meets &= GE(base + most + slack, (vf)(0.0f));
        }
        rows |= row_bits(meets) << first;
        for (int k = 0; k < 2; ++k) {
            const Form p = form_of(k ? &t->under : &t->over, lane);
            vf base = fma(at.x, (vf)(p.of[Y]), (vf)(p.of[ONE]));
            if (OUTER > 1) base = fma(at.u, (vf)(p.of[V]), base);
            VSTORE(base, f->base[3 + k] + first);
            f->x[k] = p.of[X];
            f->u[k] = OUTER > 1 ? p.of[U] : 0.0f;
        }
    }
    return rows;
}

inline vf edge_along(const RowForms *f, int k, int row, Row at)
{
    return add_places(at, (vf)(f->base[k][row]), (vf)(f->along[k][row]), (vf)(f->across[k][row]));
}
inline vf plane_along(const RowForms *f, int k, int row, Row at)
{
    return add_places(at, (vf)(f->base[3 + k][row]), (vf)(f->x[k]), (vf)(f->u[k]));
}

// A triangle that can touch no more than LANES rays: all of them at once, wherever in the block
// they are.
inline int hit_few(const Triangles *t, uint lane, int covers, int edge_on, int id,
                   const Coverage *to)
{
    private int place[LANES];
    private float found[LANES];
    int count = 0;
    for (int k = 0; k < LANES; ++k) place[k] = 0;
    for (uint rows = t->rows[lane]; rows; rows &= rows - 1)
        for (uint columns = t->columns[lane]; columns; columns &= columns - 1)
            place[count++] = lowest(rows) * BLOCK + lowest(columns);
    const vi at = VLOAD(place), column = at & (BLOCK - 1), row = at / BLOCK;
    const vf x = TO_VF(column & (INNER - 1)) - HALF, u = TO_VF(column / INNER) - OUTER_HALF;
    const vf y = TO_VF(row & (INNER - 1)) - HALF, v = TO_VF(row / INNER) - OUTER_HALF;
    vf e[5], depth;
    for (int k = 0; k < 5; ++k) {
        const Form f = form_of(k < 3 ? t->edge + k : k == 3 ? &t->over : &t->under, lane);
        vf base = fma(y, (vf)(f.of[Y]), (vf)(f.of[ONE])), along = f.of[X];
        if (OUTER > 1) {
            base = fma(v, (vf)(f.of[V]), base);
            if (k < 3) along = fma(-v, (vf)(f.of[TWIST]), along);
        }
        e[k] = fma(x, along, base);
        if (OUTER == 1) continue;
        const vf across = k < 3 ? fma(y, (vf)(f.of[TWIST]), (vf)(f.of[U])) : (vf)(f.of[U]);
        e[k] = fma(u, across, e[k]);
    }
    const vi mask = meet(e[0], e[1], e[2], e[3], e[4], covers, edge_on, &depth);
    int changed = 0;
    VSTORE(depth, found);
    for (uint bits = row_bits(mask) & ((1u << count) - 1u); bits; bits &= bits - 1) {
        const uint k = lowest(bits);
        const int ray = place[k], old_id = to->ids[ray];
        const uint new = as_uint(found[k]), old = as_uint(to->z[ray]);
        const int nearer = (new < old) | ((new == old) & (id < old_id));
        to->z[ray] = as_float(nearer ? new : old);
        to->ids[ray] = nearer ? id : old_id;
        changed |= nearer;
    }
    return changed;
}

// Merge one of LANES triangles into the depth buffer; returns whether anything changed.
inline int hit_triangle(const Triangles *t, uint lane, int id, const Bundle *rays,
                        const CutOuts *cut_outs, const Coverage *to)
{
    uint rows = t->rows[lane];
    const uint columns = t->columns[lane];
    const int covers = t->covers >> lane & 1, edge_on = t->edge_on >> lane & 1;
    const int holes = has_holes(cut_outs, id);
    if (!holes && popcount(rows) * popcount(columns) <= LANES)
        return hit_few(t, lane, covers, edge_on, id, to);
    RowForms f;
    const uint open = make_row_forms(t, lane, rows, &f);
    if (!edge_on) rows &= open;
    int changed = 0;
    for (; rows; rows &= rows - 1) {
        const int row = lowest(rows);
        for (int column = 0; column < BLOCK; column += LANES) {
            if (!(columns >> column & ((1u << LANES) - 1u))) continue;
            const Row place = row_at(column);
            vf depth;
            vi mask = meet(edge_along(&f, 0, row, place), edge_along(&f, 1, row, place),
                           edge_along(&f, 2, row, place), plane_along(&f, 0, row, place),
                           plane_along(&f, 1, row, place), covers, edge_on, &depth);
            global float *z = to->z + row * BLOCK + column;
            global int *ids = to->ids + row * BLOCK + column;
            const vf old_z = VLOAD(z);
            const vi old_id = VLOAD(ids);
            mask &= is_nearer(depth, id, old_z, old_id);
            if (holes) {
                const Row at = row_at(row * BLOCK + column);
                const uint bits = row_bits(mask);
                mask = mask_of_bits(stopped_rays(cut_outs, id, rays, at, depth, bits));
            }
            if (!row_any(mask)) continue;
            VSTORE(pick(old_z, depth, mask), z);
            VSTORE(pick_int(old_id, (vi)(id), mask), ids);
            changed = 1;
        }
    }
    return changed;
}

#endif
