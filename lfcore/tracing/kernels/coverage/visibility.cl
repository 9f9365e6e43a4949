// Which triangle each ray of a packet meets first.
//
// The packet walks the hierarchy as one, front to back.  Leaves are gathered in a list; every block
// then culls the list by its own, narrower frustum, and triangles by their edge functions.  Nodes
// behind the farthest visible depth are dropped.
#ifndef LFCORE_VISIBILITY_CL
#define LFCORE_VISIBILITY_CL
#include "depth_buffer.cl"
#include "walk.cl"

#define LIST 64
#define VISIBILITY_WORDS (PACKET_BLOCKS * COVERAGE_WORDS + LIST_WORDS(LIST))

// The packet's blocks, and the worker's memory for them.
typedef struct {
    Coverage block[PACKET_BLOCKS];
    LeafList leaves;
} Visibility;

inline void start_visibility(global uint *memory, Visibility *v)
{
    for (int block = 0; block < PACKET_BLOCKS; ++block)
        clear_coverage(memory + block * COVERAGE_WORDS, v->block + block);
    v->leaves = make_list(memory + PACKET_BLOCKS * COVERAGE_WORDS, LIST);
}

// Test one block against a leaf.
inline void visit_leaf(const Tree *tree, const Bundle *bundle, int leaf, Coverage *c)
{
    Triangles t;
    int changed = 0;
    for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
        set_up_triangles(bundle, leaf_corners(tree, leaf, lane), c->z_far, &t);
        for (uint keep = t.keep; keep; keep &= keep - 1) {
            const uint k = lowest(keep);
            const int id = leaf_numbers(tree, leaf, lane)[k];
            const int whole = (t.covers >> k & 1) && !has_holes(&tree->cut_outs, id);
            if (whole && settle_cover(&t.coefficients, k, id, c)) continue;
            use_buffer(c);
            changed |= hit_triangle(&t, k, id, bundle, &tree->cut_outs, c);
        }
    }
    if (changed) find_farthest(c);
}

// Test one block against the gathered leaves.
inline void visit_block(const Tree *tree, const Bundle *bundle, const LeafList *list, Coverage *c)
{
    const Frustum frustum = block_frustum(bundle);
    for (int base = 0; base < list->count; base += LANES) {
        const vi meets = frustum_meets(&frustum, list->boxes + base, list->pitch, c->z_far);
        for (uint bits = row_bits(meets) & listed_bits(list, base); bits; bits &= bits - 1) {
            const int slot = base + lowest(bits);
            if (list->boxes[2 * list->pitch + slot] > c->z_far) continue;
            visit_leaf(tree, bundle, list->leaf[slot], c);
        }
    }
}

// The farthest that a block still sees of what is to come.
inline float farthest_open(const Packet *p, const Visibility *v)
{
    float far = 0.0f;
    for (int block = 0; block < PACKET_BLOCKS; ++block)
        if (has_block(p, block)) far = max(far, v->block[block].z_far);
    return far;
}

// Rays that have little in common are followed one by one: what their block would have to set up is
// far more than what they share.
inline void follow_rays(const Tree *tree, const Bundle *r, int2 inside, Coverage *c)
{
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        const int i = at % BLOCK, j = at / BLOCK;
        const float x = i - HALF, y = j - HALF;
        Hit hit = {FAR, -1, (float3)(0.0f)};
        int exponent = 0;
        if (i < inside.x && j < inside.y) {
            const float3 origin = (float3)(fma(x, r->sx, r->ox), fma(y, r->sy, r->oy), 0.0f);
            const float3 along = (float3)(fma(x, r->tx, r->dx), fma(y, r->ty, r->dy), 1.0f);
            const Ray ray = scaled_ray(origin, along, &exponent);
            closest_hit(tree, &ray, &hit);
        }
        c->z[at] = hit.id < 0 ? INFINITY : ldexp(hit.t, -exponent);
        c->ids[at] = hit.id;
    }
    c->cover = BUFFERED;
}

// Find what every block of the packet sees.
inline void find_visible(const Tree *tree, const Packet *p, Visibility *v)
{
    for (int block = 0; SINGLE_RAYS && block < PACKET_BLOCKS; ++block) {
        if (!has_block(p, block)) continue;
        const Bundle bundle = block_bundle(p, block);
        follow_rays(tree, &bundle, block_inside(p, block), v->block + block);
    }
    if (SINGLE_RAYS) return;
    const Frustum frustum = packet_frustum(p);
    const Volume volume = {&frustum, 0, 0};
    Stack stack;
    start_walk(&stack);
    while (stack.size) {
        v->leaves.count = 0;
        gather_leaves(tree, &volume, farthest_open(p, v), &stack, &v->leaves);
        for (int block = 0; block < PACKET_BLOCKS; ++block) {
            if (!has_block(p, block)) continue;
            const Bundle bundle = block_bundle(p, block);
            visit_block(tree, &bundle, &v->leaves, v->block + block);
        }
    }
}

#endif
