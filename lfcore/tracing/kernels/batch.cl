// Triangles set up once for all blocks of a beam.
//
// The blocks of one element have the same steps, and so forms over one are those over another with only the
// constant moved: c + x i + y j, where x and y, how far a block's centre lies from the beam's, are whole
// numbers of blocks.  A batch keeps the forms about the beam's centre of what some ray of the beam may meet.
#ifndef LFCORE_BATCH_CL
#define LFCORE_BATCH_CL
#include "triangles.cl"

#if SHARED
#define BATCH (4 * LANES)
// Of more leaves in a beam's way triangles are small, and few blocks would share one: measured.
#ifndef FEW_LEAVES
#define FEW_LEAVES 32
#endif

// Rows of a batch after COEFFICIENTS: bounds of the edges' errors, the depth that all of it lies beyond, the columns
// and rows of the beam that it can touch, and the depth that it hides everything beyond, or FAR.
enum { NOISE = COEFFICIENTS, NEAREST = NOISE + 3, LEFT, RIGHT, TOP, BOTTOM, HIDES, BATCH_ROWS };

typedef struct {
    float row[BATCH_ROWS][BATCH];
    int id[BATCH];
    int count;
    float z_far;  // nothing beyond is of interest
} Batch;

// Bounds of the depth at which the rays within `extent` columns and rows of the centre pass the planes of
// triangles: depth is linear-fractional, so as long as its denominator is positive the extremes are at the
// corners.  Where that is not sure, `near` is negative.
inline void plane_depths(Affine over, Affine under, vi mixed, float extent, vf *near, vf *far)
{
    const vf oi = extent * over.i, oj = extent * over.j, ui = extent * under.i, uj = extent * under.j;
    const vf o0 = over.c - oi, o1 = over.c + oi, u0 = under.c - ui, u1 = under.c + ui;
    const vf ua = u0 - uj, ub = u0 + uj, uc = u1 - uj, ud = u1 + uj;
    const vf oa = o0 - oj, ob = o0 + oj, oc = o1 - oj, od = o1 + oj;
    const vf a = oa * reciprocal(ua), b = ob * reciprocal(ub), c = oc * reciprocal(uc), d = od * reciprocal(ud);
    // Of numbers that vary no more, those of a ray are off by a fifth of the slack at most, as are these.
    const vf least_o = min(min(oa, ob), min(oc, od)), least_u = min(min(ua, ub), min(uc, ud));
    const vi even = GE(2.0f * least_o, max(max(oa, ob), max(oc, od))) & GE(2.0f * least_u, max(max(ua, ub), max(uc, ud)));
    const vi known = GT(min(least_o, least_u), (vf)(1.0e-30f)) & even & ~mixed;
    const float slack = 4.0e-6f;
    *near = pick((vf)(-1.0f), min(min(a, b), min(c, d)) * (1.0f - slack), known);
    *far = max(max(a, b), max(c, d)) * (1.0f + slack);
}

// Add those of the LANES triangles at `leaf` that the beam may meet; there must be room for all.
inline void add_to_batch(const Bundle *beam, global const float *leaf, global const int *ids, Batch *batch)
{
    const Corners v = shear_corners(beam, leaf);
    const Reach reach = reach_of(&v, beam, FORM_HALF, batch->z_far);
    vi keep = reach.keep;
    if (!row_any(keep)) return;
    const Edges e = make_edges(&v, beam);
    Edges wide = e;
    const Lie lie = lie_of(&wide, FORM_HALF);
    keep &= lie.meets;
    if (!row_any(keep)) return;
    vf left, right, top, bottom, near, far;
    span_samples(v.px, v.qx, v.rx, v.pz, v.qz, v.rz, reach.noise_x, beam->sx, beam->tx, FORM_HALF, &left, &right);
    span_samples(v.py, v.qy, v.ry, v.pz, v.qz, v.rz, reach.noise_y, beam->sy, beam->ty, FORM_HALF, &top, &bottom);
    keep &= LE(left, right) & LE(top, bottom);
    private float rows[BATCH_ROWS * LANES];
    Affine over, under;
    const Edges turned = turn_edges(e, lie.flip);
    store_edges(&turned, rows);
    plane_forms(&v, beam, lie.flip, &over, &under);
    store_flat(over, rows + 3 * EDGE * LANES);
    store_flat(under, rows + (3 * EDGE + FLAT) * LANES);
    plane_depths(over, under, lie.mixed, FORM_HALF, &near, &far);
    const vf hides = pick((vf)(FAR), far, keep & lie.covers & GT(near, (vf)(0.0f)));
    batch->z_far = min(batch->z_far, row_min(hides));
    uint bits = row_bits(keep & LE(near, (vf)(batch->z_far)));
    if (!bits) return;
    VSTORE(e.noise0, rows + NOISE * LANES);
    VSTORE(e.noise1, rows + (NOISE + 1) * LANES);
    VSTORE(e.noise2, rows + (NOISE + 2) * LANES);
    VSTORE(max(reach.z_lo, near), rows + NEAREST * LANES);
    VSTORE(left, rows + LEFT * LANES);
    VSTORE(right, rows + RIGHT * LANES);
    VSTORE(top, rows + TOP * LANES);
    VSTORE(bottom, rows + BOTTOM * LANES);
    VSTORE(hides, rows + HIDES * LANES);
    for (; bits; bits &= bits - 1) {
        const uint k = lowest(bits);
        const int to = batch->count++;
        for (int n = 0; n < BATCH_ROWS; ++n) batch->row[n][to] = rows[n * LANES + k];
        batch->id[to] = ids[k];
    }
}

// Drop what turned out to be hidden from the whole beam.
inline void prune_batch(Batch *batch)
{
    int count = 0;
    for (int k = 0; k < batch->count; ++k) {
        if (batch->row[NEAREST][k] > batch->z_far) continue;
        if (k > count) {
            for (int n = 0; n < BATCH_ROWS; ++n) batch->row[n][count] = batch->row[n][k];
            batch->id[count] = batch->id[k];
        }
        ++count;
    }
    batch->count = count;
}

#define TAKE_ROW(n) VLOAD(batch->row[n] + base)

inline Affine moved_row(const Batch *batch, int base, int n, float2 at)
{
    const Affine f = {TAKE_ROW(n), TAKE_ROW(n + 1), TAKE_ROW(n + 2)};
    return move_form(f, at);
}

// Triangles of a batch for one block: coefficients as of setup_triangles, a row of LANES triangles after the
// other, and the depths between which each lies, as far as that is known.
typedef struct {
    float coefficients[BATCH / LANES][COEFFICIENTS * LANES];
    float near[BATCH], far[BATCH];
    Cull cull[BATCH / LANES];  // covers only of known depth
} Taken;

// As setup_triangles, of row `n` of a batch, for the block at `at`.  Returns z_far or, if that is nearer, what a
// triangle that covers the block hides everything beyond.
inline float take_triangles(const Batch *batch, int n, float2 at, float z_far, Taken *taken)
{
    const int base = n * LANES;
    const float2 first = at + (FORM_HALF - HALF), last = at + (FORM_HALF + HALF);
    vi keep = LE(TAKE_ROW(LEFT), (vf)(last.x)) & GE(TAKE_ROW(RIGHT), (vf)(first.x)) & LE(TAKE_ROW(TOP), (vf)(last.y)) &
              GE(TAKE_ROW(BOTTOM), (vf)(first.y)) & LE(TAKE_ROW(NEAREST), (vf)(z_far)) & LT(IOTA, (vf)(batch->count - base));
    const Cull none = {0, 0, 0};
    taken->cull[n] = none;
    if (!row_any(keep)) return z_far;
    Edges e;
    e.e0 = moved_row(batch, base, 0, at);
    e.e1 = moved_row(batch, base, EDGE, at);
    e.e2 = moved_row(batch, base, 2 * EDGE, at);
    e.noise0 = TAKE_ROW(NOISE);
    e.noise1 = TAKE_ROW(NOISE + 1);
    e.noise2 = TAKE_ROW(NOISE + 2);
    const Lie lie = lie_of(&e, HALF);
    keep &= lie.meets;
    if (!row_any(keep)) return z_far;
    const Affine over = flip_edge(moved_row(batch, base, 3 * EDGE, at), lie.flip);
    const Affine under = flip_edge(moved_row(batch, base, 3 * EDGE + FLAT, at), lie.flip);
    vf near, far;
    plane_depths(over, under, lie.mixed, HALF, &near, &far);
    const vi hides = keep & lie.covers & GT(near, (vf)(0.0f));
    z_far = min(z_far, row_min(pick((vf)(FAR), far, hides)));
    keep &= LE(near, (vf)(z_far));
    const uint bits = row_or((keep & LANE_BITS) | (hides & (LANE_BITS << 16)));
    taken->cull[n].keep = bits & 0xffff;
    taken->cull[n].cover = bits >> 16;
    if (row_any(keep & lie.mixed)) taken->cull[n].mixed = row_bits(lie.mixed);
    VSTORE(near, taken->near + base);
    VSTORE(far, taken->far + base);
    store_edges(&e, taken->coefficients[n]);
    store_flat(over, taken->coefficients[n] + 3 * EDGE * LANES);
    store_flat(under, taken->coefficients[n] + (3 * EDGE + FLAT) * LANES);
    return z_far;
}

// Rows and columns of the block at `at` that triangles of row `n` can touch, as of setup_triangles.
inline void span_taken(const Batch *batch, int n, float2 at, const Taken *taken, private int *span)
{
    const int base = n * LANES;
    const float2 corner = at + (FORM_HALF - HALF);
    private const float *c = taken->coefficients[n];
    Edges e;
    e.e0.c = VLOAD(c); e.e0.i = VLOAD(c + LANES); e.e0.j = VLOAD(c + 2 * LANES);
    c += EDGE * LANES;
    e.e1.c = VLOAD(c); e.e1.i = VLOAD(c + LANES); e.e1.j = VLOAD(c + 2 * LANES);
    c += EDGE * LANES;
    e.e2.c = VLOAD(c); e.e2.i = VLOAD(c + LANES); e.e2.j = VLOAD(c + 2 * LANES);
    const vi mixed = MASK(((vi)(taken->cull[n].mixed) & LANE_BITS) != 0);
    const vf left = max(TAKE_ROW(LEFT) - corner.x, (vf)(0.0f)), right = min(TAKE_ROW(RIGHT) - corner.x, (vf)(2.0f * HALF));
    const vf first = max(TAKE_ROW(TOP) - corner.y, (vf)(0.0f)), last = min(TAKE_ROW(BOTTOM) - corner.y, (vf)(2.0f * HALF));
    store_span(&e, mixed, left, right, first, last, span);
}
#undef TAKE_ROW

#endif

#endif
