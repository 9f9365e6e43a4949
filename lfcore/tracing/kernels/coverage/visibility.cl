// Which triangle each ray of a packet meets first.
//
// The packet walks the hierarchy as one, front to back.  Leaves are collected in a list of
// candidates; every block culls the list by its own, narrower frustum, and triangles by their edge
// functions.  Nodes behind the farthest visible depth are dropped.
#pragma once
#include "compaction.cl"
#include "depth_buffer.cl"
#include "walk.cl"

// Packets pack their triangles while so many of their leaves are left.
#define MOST_PACKED 0.5f

// A worker's own memory.
typedef struct {
    DepthBuffer buffers[MOST_BLOCKS];
    ListedLeaves candidates;
    CompactedLeaves compacted;
} VisibilityMemory;

// The packet's blocks, and the leaves in their way.
typedef struct {
    Coverage block[MOST_BLOCKS];
    global ListedLeaves *candidates;
    global CompactedLeaves *compacted;
} Visibility;

inline void start_visibility(const Rays *rays, global VisibilityMemory *memory, Visibility *v)
{
    for (int block = 0; block < rays->blocks; ++block)
        clear_coverage(memory->buffers + block, rays->half_extent, v->block + block);
    v->candidates = &memory->candidates;
    v->compacted = &memory->compacted;
}

// Test one block against a leaf.  What covers the block comes first: often nothing lies before it,
// and no depth buffer is needed.
inline void visit_leaf(const Tree *tree, const Bundle *bundle, int leaf, Coverage *c)
{
    Triangles t;
    int changed = 0;
    for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
        global const int *ids = leaf_numbers(tree, leaf, lane);
        set_up_triangles(bundle, leaf_corners(tree, leaf, lane), c->z_far, &t);
        for (uint whole = t.keep & t.covers; whole; whole &= whole - 1) {
            const uint k = lowest(whole);
            if (has_holes(&tree->cut_outs, ids[k])) continue;
            if (try_full_cover(&t, k, ids[k], c)) t.keep ^= 1u << k;
        }
        for (uint keep = t.keep; keep; keep &= keep - 1) {
            const uint k = lowest(keep);
            if (t.near[k] > c->z_far) continue;
            use_buffer(c);
            changed |= hit_triangle(&t, k, ids[k], bundle, &tree->cut_outs, c);
        }
    }
    if (changed) find_farthest(c);
}

// Test one block against the gathered leaves.
inline void visit_block(const Tree *tree, const Bundle *bundle, const LeafList *list, Coverage *c)
{
    const Frustum frustum = make_frustum(bundle, bundle);
    for (int base = 0; base < list->count; base += LANES) {
        const int left = list->count - base;
        const uint listed = left < LANES ? (1u << left) - 1u : ~0u;
        global const Boxes *boxes = boxes_from(list->of->boxes + base / NODE_WIDTH,
                                               base % NODE_WIDTH);
        const vi meets = frustum_meets(&frustum, boxes, c->z_far);
        for (uint bits = row_bits(meets) & listed; bits; bits &= bits - 1) {
            const int k = lowest(bits);
            if (boxes->low[2][k] > c->z_far) continue;
            visit_leaf(tree, bundle, list->of->leaf[base + k], c);
        }
    }
}

// The farthest that a block still sees of what is to come.
inline float farthest_open(const Packet *p, const Visibility *v)
{
    float far = 0.0f;
    for (int block = 0; block < p->rays->blocks; ++block)
        if (has_block(p, block)) far = max(far, v->block[block].z_far);
    return far;
}

// Rays that have little in common are followed one by one: what their block would have to set up is
// far more than what they share.
inline void follow_rays(const Tree *tree, const Bundle *r, int2 inside, Coverage *c)
{
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        const int i = at % BLOCK, j = at / BLOCK;
        const float x = i - r->half_extent, y = j - r->half_extent;
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
    c->covering_triangle = BUFFERED;
}

// Find what every block of the packet sees.
inline void find_visible(const Tree *tree, const Packet *p, Visibility *v)
{
    const int blocks = p->rays->blocks;
    for (int block = 0; SINGLE_RAYS && block < blocks; ++block) {
        if (!has_block(p, block)) continue;
        const Bundle bundle = block_bundle(p, block);
        follow_rays(tree, &bundle, block_inside(p, block), v->block + block);
    }
    if (SINGLE_RAYS) return;
    const Frustum frustum = packet_frustum(p);
    const Volume volume = {FRUSTUM, &frustum};
    Stack stack;
    start_walk(&stack);
    // Several blocks of one element meet much the same triangles.  Of a packet so wide that it may
    // hit most triangles of its leaves, few would be left out.
    int compact = p->rays->group == 1 && blocks > 1;
    const Tree packed = compacted_tree(tree, v->compacted);
    while (stack.size) {
        const float far = farthest_open(p, v);
        LeafList list = {v->candidates, 0};
        gather_leaves(tree, &volume, far, &stack, &list);
        const Tree *leaves = compact ? &packed : tree;
        if (compact) {
            const int all = list.count;
            list = compact_triangles(tree, p, far, &list, v->compacted);
            compact = list.count < MOST_PACKED * all;
        }
        for (int block = 0; block < blocks; ++block) {
            if (!has_block(p, block)) continue;
            const Bundle bundle = block_bundle(p, block);
            visit_block(leaves, &bundle, &list, v->block + block);
        }
    }
}
