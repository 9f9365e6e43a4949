// Which triangle each ray of a beam of blocks meets first.
//
// A beam of BEAM_BLOCKS blocks walks the hierarchy together.  Children are stored by their nearest
// depth, and every ray looks along +z, so the walk is front to back without sorting.  Leaves are
// gathered in a list; every block then culls the list by its own, narrower beam, and what remains
// by affine edge functions.  Nodes behind the farthest visible depth are dropped.
#ifndef LFCORE_VISIBILITY_CL
#define LFCORE_VISIBILITY_CL
#include "merge.cl"

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
// one triangle: such a block keeps six coefficients, and no depth buffer until another one may be seen, too.
#define NOTHING -1   // no triangle yet, depth buffer not written
#define BUFFERED -2  // depth buffer in use; any other value: the one triangle that is seen
typedef struct {
    int cover;            // NOTHING, BUFFERED or a triangle
    float z_near, z_far;  // depth range of all that the block sees; z_far is FAR while a ray sees nothing
    Form over, under;     // of the cover; depth is their quotient
} BlockState;

// A block that has seen nothing, to be tested up to z_far.
inline void clear_block(BlockState *state, float z_far)
{
    state->cover = NOTHING;
    state->z_near = FAR;
    state->z_far = z_far;
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
}

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

// A triangle that every ray of the block passes through: settle it if depth ranges part.
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
    if (!(z_near > 0.0f)) return 0;
    if (z_near > state->z_far) return 1;
    if (!(z_far < state->z_near)) return 0;
    state->cover = id;
    state->z_near = z_near;
    state->z_far = z_far;
    state->over = over;
    state->under = under;
    return 1;
}

// Test one block against the gathered leaves.
inline void visit_block(const Bvh *bvh, const Bundle *block, const LeafList *list, BlockState *state, global float *z, global int *ids)
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
                const Cull cull = setup_triangles(block, bvh->leaves + leaf * 9 * NODE_WIDTH + lane, state->z_far, coefficients, rows);
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

#endif
