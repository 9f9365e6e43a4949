// Which triangle each ray of a beam of blocks meets first.
//
// A beam of BEAM_BLOCKS blocks walks the hierarchy together.  Children are stored by their nearest
// depth, and every ray looks along +z, so the walk is front to back without sorting.  Leaves are
// gathered in a list; every block then culls the list by its own, narrower beam, and what remains
// by affine edge functions.  Nodes behind the farthest visible depth are dropped.
#ifndef LFCORE_VISIBILITY_CL
#define LFCORE_VISIBILITY_CL
#include "merge.cl"
#include "batch.cl"
#include "parts.cl"

// STACK, given on building, is what the deepest walk through this hierarchy can leave on its stack.
#define LIST 64

typedef struct {
    global const float *boxes;    // (K, 6, 16) children of the wide nodes
    global const int *children;   // (K, 16)
    global const float *leaves;   // (L, 9, 16) corners
    global const int *leaf_ids;   // (L, 16)
} Bvh;

// The kernels' first parameters, and what they make.
#define BVH_PARAMETERS                   \
    global const float *restrict boxes,  \
    global const int *restrict children, \
    global const float *restrict leaves, \
    global const int *restrict leaf_ids
#define MAKE_BVH {boxes, children, leaves, leaf_ids}

// Leaves that a walk has gathered: their boxes as structure of arrays, and which they are.
typedef struct {
    global float *boxes;  // (6, pitch)
    global int *leaf;     // (pitch,)
    int pitch, count;
} LeafList;

typedef struct {
    int node[STACK];
    float z[STACK];
    int size;
} Walk;

inline void append_leaf(LeafList *list, global const float *box, int child)
{
    const int at = list->count++;
    for (int k = 0; k < 6; ++k) list->boxes[k * list->pitch + at] = box[k * NODE_WIDTH];
    list->leaf[at] = -1 - child;
}

// Put the children in `bits` on the list and on the stack, the nearest on top.
inline void descend(const Bvh *bvh, int node, uint bits, Walk *walk, LeafList *list)
{
    global const int *children = bvh->children + node * NODE_WIDTH;
    global const float *boxes = bvh->boxes + node * 6 * NODE_WIDTH;
    for (uint rest = bits; rest; rest &= rest - 1) {
        const uint lane = lowest(rest);
        if (children[lane] < 0) append_leaf(list, boxes + lane, children[lane]);
    }
    while (bits) {
        const uint lane = 31 - clz(bits);
        bits ^= 1u << lane;
        if (children[lane] >= 0) {
            walk->node[walk->size] = children[lane];
            walk->z[walk->size++] = boxes[2 * NODE_WIDTH + lane];
        }
    }
}

// Walk until the list could overflow or nothing is left.
inline void gather(const Bvh *bvh, const Beam *beam, float z_far, Walk *walk, LeafList *list)
{
    while (walk->size && list->count <= list->pitch - NODE_WIDTH) {
        const int node = walk->node[--walk->size];
        if (walk->z[walk->size] > z_far) continue;
        global const float *boxes = bvh->boxes + node * 6 * NODE_WIDTH;
        uint bits = 0;
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
            bits |= row_bits(beam_meets(beam, boxes + lane, NODE_WIDTH, z_far)) << lane;
        descend(bvh, node, bits, walk, list);
    }
}

// What is known of a block while its triangles are tested.  Most blocks of a dense slab lie wholly on
// one triangle: such a block keeps six coefficients.  Where few triangles lie before that one, or before nothing, it keeps
// their parts, and no depth buffer until something forces one.
#define NOTHING -1   // no triangle yet, depth buffer not written
#define BUFFERED -2  // depth buffer in use; any other value: the one triangle behind all parts
typedef struct {
    int cover;            // NOTHING, BUFFERED or a triangle
    float z_near, z_far;  // depth range of all that the block sees; z_far is FAR while a ray sees nothing
    Form over, under;     // of the cover; depth is their quotient
#if SHARED
    float near, far;      // depth range of the cover
    int divided;          // whether there are parts
    global Parts *parts;  // valid if there are any
#endif
} BlockState;

// A block that has seen nothing, to be tested up to z_far.
inline void clear_block(BlockState *state, float z_far)
{
    state->cover = NOTHING;
    state->z_near = FAR;
    state->z_far = z_far;
#if SHARED
    state->divided = 0;
#endif
}

inline int sees_nothing(const BlockState *state)
{
#if SHARED
    if (state->divided) return 0;
#endif
    return state->cover == NOTHING;
}

inline vf quotient_row(Form over, Form under, Row at) { return flat_row(over, at) * reciprocal(flat_row(under, at)); }

// Write the depth buffer of a block that so far had none.
inline void materialise(BlockState *state, global float *z, global int *ids)
{
    if (state->cover == BUFFERED) return;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        VSTORE((vi)(state->cover), ids + at);
        VSTORE(state->cover == NOTHING ? (vf)(INFINITY) : quotient_row(state->over, state->under, row_at(at)), z + at);
    }
    state->cover = BUFFERED;
#if SHARED
    for (int k = 0; state->divided && k < state->parts->count; ++k) {
        global const Part *p = state->parts->of + k;
        const uint2 places = places_of(p->rays, BLOCK);
        for (int column = 0; column < BLOCK; column += LANES) {
            if (!(places.x >> column & ((1u << LANES) - 1u))) continue;
            for (int row = lowest(places.y); places.y >> row; ++row) {
                const int at = row * BLOCK + column;
                const vi mine = part_row(p, at);
                VSTORE(pick(VLOAD(z + at), quotient_row(p->over, p->under, row_at(at)), mine), z + at);
                VSTORE(pick_int(VLOAD(ids + at), (vi)(p->id), mine), ids + at);
            }
        }
    }
    state->divided = 0;
#endif
}

#if SHARED
// Triangles of a block that has no depth buffer, ray by ray: some rows at a time, which stay in registers.
#define ID_ROWS 4
inline void write_ids(const BlockState *state, global int *ids)
{
    for (int at = 0; at < BLOCK_RAYS; at += ID_ROWS * BLOCK) {
        vi id[ID_ROWS * BLOCK / LANES];
        for (int k = 0; k < ID_ROWS * BLOCK / LANES; ++k) id[k] = state->cover;
        for (int n = 0; n < state->parts->count; ++n) {
            global const Part *p = state->parts->of + n;
            const vi own = p->id;
            for (int k = 0; k < ID_ROWS * BLOCK / LANES; ++k) {
                const int ray = k * LANES;
                // A ray's bit comes to be the sign.
                const vi mine = (vi)(p->rays[(at + ray) / BLOCK]) << (31 - ray % BLOCK - TO_VI(IOTA));
                id[k] = pick_int(id[k], own, LT(mine, (vi)(0)));
            }
        }
        for (int k = 0; k < ID_ROWS * BLOCK / LANES; ++k) VSTORE(id[k], ids + at + k * LANES);
    }
}
#endif

inline float farthest(global const float *z)
{
    vf far = VLOAD(z);
    for (int k = LANES; k < BLOCK_RAYS; k += LANES) far = max(far, VLOAD(z + k));
    return min(row_max(far), FAR);
}

inline Form read_flat(private const float *c, uint lane)
{
    Form f;
    f.c = c[lane]; f.i = c[LANES + lane]; f.j = c[2 * LANES + lane];
#if OUTER > 1
    f.p = c[3 * LANES + lane]; f.q = c[4 * LANES + lane]; f.k = 0.0f;
#endif
    return f;
}

// Values of a form without k at the inner grid's corners, of the element at corner `outer` of the elements.
inline float4 corners_of(Form f, int outer)
{
    const float4 x = (float4)(-HALF, HALF, -HALF, HALF), y = (float4)(-HALF, -HALF, HALF, HALF);
#if OUTER > 1
    f.c = fma(outer & 1 ? OUTER_HALF : -OUTER_HALF, f.p, fma(outer & 2 ? OUTER_HALF : -OUTER_HALF, f.q, f.c));
#endif
    return fma(x, (float4)(f.i), fma(y, (float4)(f.j), (float4)(f.c)));
}

// A triangle that every ray of the block passes through, between z_near and z_far: settle it if depth ranges part.
inline int settle(Form over, Form under, float z_near, float z_far, int id, BlockState *state)
{
    if (!(z_near > 0.0f)) return 0;
    if (z_near > state->z_far) return 1;
    if (!(z_far < state->z_near)) return 0;
    state->cover = id;
    state->z_near = z_near;
    state->z_far = z_far;
    state->over = over;
    state->under = under;
#if SHARED
    state->near = z_near;
    state->far = z_far;
    state->divided = 0;
#endif
    return 1;
}

// The same where it is not known yet how deep the triangle lies.
// Depth is linear-fractional with a denominator of one sign, so its extremes are at the corners.
inline int settle_cover(private const float *c, uint lane, int id, BlockState *state)
{
    const Form over = read_flat(c + 3 * EDGE * LANES, lane), under = read_flat(c + (3 * EDGE + FLAT) * LANES, lane);
    float4 least = FAR, most = -FAR;
    for (int k = 0; k < (OUTER > 1 ? 4 : 1); ++k) {
        const float4 z = corners_of(over, k) / corners_of(under, k);
        least = min(least, z);
        most = max(most, z);
    }
    const float slack = 1.0e-6f;
    const float z_near = min(min(least.x, least.y), min(least.z, least.w)) * (1.0f - slack);
    const float z_far = max(max(most.x, most.y), max(most.z, most.w)) * (1.0f + slack);
    return settle(over, under, z_near, z_far, id, state);
}

// Test one block, `at` columns and rows from the centre of `about`, against the gathered leaves.
inline void visit_block(const Bvh *bvh, const Bundle *block, const Bundle *about, float2 at, const LeafList *list, BlockState *state,
                        global float *z, global int *ids)
{
    private float coefficients[COEFFICIENTS * LANES];
    private int rows[4 * LANES];
    const Beam beam = block_beam(block);
    for (int base = 0; base < list->count; base += LANES) {
        uint near = row_bits(beam_meets(&beam, list->boxes + base, list->pitch, state->z_far));
        if (base + LANES > list->count) near &= (1u << (list->count - base)) - 1u;
        for (; near; near &= near - 1) {
            const int slot = base + lowest(near), leaf = list->leaf[slot];
            if (list->boxes[2 * list->pitch + slot] > state->z_far) continue;
            int changed = 0;
            for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
                const Cull cull = setup_triangles(block, about, at, bvh->leaves + leaf * 9 * NODE_WIDTH + lane, state->z_far,
                                                  coefficients, rows);
                for (uint keep = cull.keep; keep; keep &= keep - 1) {
                    const uint k = lowest(keep);
                    const int id = bvh->leaf_ids[leaf * NODE_WIDTH + lane + k], covers = (cull.cover >> k) & 1;
                    if (covers && state->cover != BUFFERED && settle_cover(coefficients, k, id, state)) continue;
                    materialise(state, z, ids);
                    changed |= hit_triangle(coefficients, k, covers, (cull.mixed >> k) & 1, rows, id, z, ids);
                }
            }
            if (changed) state->z_far = farthest(z);
        }
    }
}

#if SHARED
// Nothing is seen beyond the parts.
inline void fill_state(BlockState *state)
{
    global const Parts *parts = state->parts;
    global const Part *first = parts->of;
    float far = first->far;
    for (int k = 1; k < parts->count; ++k) far = max(far, parts->of[k].far);
    state->z_far = far;
    if (parts->count > 1) return;
    state->cover = first->id;
    state->over = first->over;
    state->under = first->under;
    state->near = first->near;
    state->far = first->far;
    state->divided = 0;
}

// See triangle `k` of LANES, within some rows, in front of a block that has no depth buffer; false if it needs one.
inline int see_part(private const float *c, uint k, float2 rows, int id, float near, float far, BlockState *state)
{
    if (!(near > 0.0f) || !(far < FAR)) return 0;
    for (int edge = 0; edge < 3; ++edge) {
        const float turn = fabs(c[(3 * edge + 1) * LANES + k]);
        if (turn > 0.0f && turn < LEAST_TURN) return 0;
    }
    global Parts *parts = state->parts;
    if (!state->divided) clear_parts(parts);
    global Part *p = parts->of + parts->count;
    if (!find_rays(c, k, rows.x, rows.y, p->rays)) return 1;
    p->id = id;
    p->over = read_flat(c + 3 * EDGE * LANES, k);
    p->under = read_flat(c + (3 * EDGE + FLAT) * LANES, k);
    p->near = near;
    p->far = far;
    if (state->cover != NOTHING && !(far < state->near)) {
        if (near > state->far) return 1;
        const Order order = make_order(p->over, p->under, id, state->over, state->under, state->cover);
        for (int row = 0; row < BLOCK; row += LANES) VSTORE(nearer_rays(&order, VLOAD(p->rays + row), row), p->rays + row);
    }
    if (!add_part(parts)) return 0;
    state->z_near = min(state->z_near, parts->near);
    state->divided = parts->count > 0;
    if (state->divided && fill_block(parts)) fill_state(state);
    return 1;
}

// Merge what was taken of a batch, up to z_far, into the block at `at`: first what covers it.  Returns whether
// the depth buffer changed.
inline int merge_taken(const Batch *batch, const Taken *taken, float2 at, float z_far, BlockState *state, global float *z, global int *ids)
{
    private int span[4 * LANES];
    int changed = 0, spanned = -1;
    for (int covers = 1; covers >= 0; --covers)
        for (int n = 0; n * LANES < batch->count; ++n) {
            const Cull cull = taken->cull[n];
            private const float *c = taken->coefficients[n];
            for (uint keep = covers ? cull.keep & cull.cover : cull.keep & ~cull.cover; keep; keep &= keep - 1) {
                const uint k = lowest(keep);
                const int slot = n * LANES + k, id = batch->id[slot];
                const float near = taken->near[slot];
                if (near > z_far) continue;
                const float far = taken->far[slot];
                if (covers && state->cover != BUFFERED) {
                    const Form over = read_flat(c + 3 * EDGE * LANES, k), under = read_flat(c + (3 * EDGE + FLAT) * LANES, k);
                    if (settle(over, under, near, far, id, state)) continue;
                }
                const float2 rows = (float2)(batch->row[TOP][slot], batch->row[BOTTOM][slot]) - (at.y + FORM_HALF);
                if (state->cover != BUFFERED && see_part(c, k, rows, id, near, far, state)) {
                    z_far = min(z_far, state->z_far);
                    continue;
                }
                if (spanned != n) span_taken(batch, n, at, taken, span);
                spanned = n;
                materialise(state, z, ids);
                changed |= hit_triangle(c, k, covers, (cull.mixed >> k) & 1, span, id, z, ids);
            }
        }
    return changed;
}

// Test the block at `at` from the beam's centre against a batch.
inline void visit_with_batch(const Batch *batch, float2 at, BlockState *state, global float *z, global int *ids)
{
    Taken taken;
    float z_far = min(state->z_far, batch->z_far);
    for (int n = 0; n * LANES < batch->count; ++n) z_far = take_triangles(batch, n, at, z_far, &taken);
    int kept = state->divided ? state->parts->count : 0;
    for (int n = 0; n * LANES < batch->count; ++n) kept += popcount(taken.cull[n].keep);
    if (kept > FEW_KEPT) materialise(state, z, ids);
    if (merge_taken(batch, &taken, at, z_far, state, z, ids)) state->z_far = farthest(z);
}

// Settle all blocks by the only triangle of a batch, which covers the beam.  Returns those that it does not, a bit each.
#define BLOCK_PLACES ((SIDE * SIDE + LANES - 1) / LANES * LANES)
inline uint settle_all(const Batch *batch, private BlockState *states)
{
    private float over[BLOCK_PLACES], under[BLOCK_PLACES], near[BLOCK_PLACES], far[BLOCK_PLACES];
    Form f, g;
    f.i = batch->row[3 * EDGE + 1][0]; f.j = batch->row[3 * EDGE + 2][0];
    g.i = batch->row[3 * EDGE + FLAT + 1][0]; g.j = batch->row[3 * EDGE + FLAT + 2][0];
    for (int block = 0; block < SIDE * SIDE; block += LANES) {
        const vi number = TO_VI(IOTA) + block;
        const vf x = (TO_VF(number % SIDE) - 0.5f * (SIDE - 1)) * INNER, y = (TO_VF(number / SIDE) - 0.5f * (SIDE - 1)) * INNER;
        const Affine a = {fma(x, (vf)(f.i), fma(y, (vf)(f.j), (vf)(batch->row[3 * EDGE][0]))), f.i, f.j};
        const Affine b = {fma(x, (vf)(g.i), fma(y, (vf)(g.j), (vf)(batch->row[3 * EDGE + FLAT][0]))), g.i, g.j};
        vf z0, z1;
        plane_depths(a, b, (vi)(0), HALF, &z0, &z1);
        VSTORE(a.c, over + block);
        VSTORE(b.c, under + block);
        VSTORE(z0, near + block);
        VSTORE(z1, far + block);
    }
    uint rest = 0;
    for (int block = 0; block < SIDE * SIDE; ++block) {
        BlockState *state = states + block;
        f.c = over[block];
        g.c = under[block];
        if (state->z_far < 0.0f) continue;
        if (state->cover == BUFFERED || !settle(f, g, near[block], far[block], batch->id[0], state)) rest |= 1u << block;
    }
    return rest;
}
#endif

#endif
