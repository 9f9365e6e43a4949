// Which triangle each ray of a packet meets first.
//
// The packet walks the hierarchy as one, front to back.  Leaves are collected in a list of
// candidates; every block culls the list by its own, narrower frustum, and triangles by their edge
// functions.  Nodes
// behind the farthest visible depth are dropped.
#pragma once
#include "depth_buffer.cl"
#include "walk.cl"

// A worker's own memory.  Compacted leaves hold the candidates' triangles that the packet may hit.
typedef struct {
    DepthBuffer buffers[MOST_BLOCKS];
    ListedLeaves candidates, compacted;
    Leaf leaves[LIST];           // the compacted leaves
    int ids[LIST * NODE_WIDTH];  // (LIST, NODE_WIDTH) their triangles
} VisibilityMemory;

// The packet's blocks, and the leaves in their way.
typedef struct {
    Coverage block[MOST_BLOCKS];
    LeafList candidates, compacted;
    global VisibilityMemory *memory;
} Visibility;

inline void start_visibility(const Rays *rays, global VisibilityMemory *memory, Visibility *v)
{
    for (int block = 0; block < rays->blocks; ++block)
        clear_coverage(memory->buffers + block, rays->half_extent, v->block + block);
    v->candidates.of = &memory->candidates;
    v->compacted.of = &memory->compacted;
    v->memory = memory;
}

// Append triangle `number` to the compacted leaves.  The first triangle of a leaf clears the leaf:
// all zero, which nothing can hit, in an empty box.
inline void compact_triangle(global const Leaf *from, int id, int number, Visibility *v)
{
    const int leaf = number / NODE_WIDTH, lane = number % NODE_WIDTH;
    global Leaf *to = v->memory->leaves + leaf;
    global Boxes *boxes = v->compacted.of->boxes + leaf / NODE_WIDTH;
    for (int axis = 0; axis < 3; ++axis) {
        global float *low = boxes->low[axis] + leaf % NODE_WIDTH;
        global float *high = boxes->high[axis] + leaf % NODE_WIDTH;
        for (int k = 0; k < 3; ++k) {
            const float x = from->corner[k][axis][0];
            if (lane == 0) vstore16((float16)(0.0f), 0, to->corner[k][axis]);
            to->corner[k][axis][lane] = x;
            *low = min(lane || k ? *low : FAR, x);
            *high = max(lane || k ? *high : -FAR, x);
        }
    }
    v->memory->ids[number] = id;
    v->compacted.of->leaf[leaf] = leaf;
    v->compacted.count = leaf + 1;
}

// Compact the candidate leaves of a packet of one element: keep the triangles that the packet, as
// one wide block, may hit, so that its blocks set up few others.  No ray hits a triangle that is
// left out: if rounding widens an edge onto a ray, the ray hits the neighbour beyond that edge.
inline void compact_triangles(const Tree *tree, const Packet *p, float z_far, Visibility *v)
{
    const Bundle all = element_bundle(p, 0);
    int number = 0;
    v->compacted.count = 0;
    for (int k = 0; k < v->candidates.count; ++k)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
            const int leaf = v->candidates.of->leaf[k];
            global const Leaf *corners = leaf_corners(tree, leaf, lane);
            global const int *ids = leaf_numbers(tree, leaf, lane);
            Placed placed;
            uint bits = row_bits(place_triangles(&all, corners, z_far, 1, &placed));
            for (; bits; bits &= bits - 1, ++number) {
                const int k = lowest(bits);
                compact_triangle(leaf_corners(tree, leaf, lane + k), ids[k], number, v);
            }
        }
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
    // Several blocks of one element meet much the same triangles.
    const int compact = p->rays->group == 1 && blocks > 1;
    Tree leaves = *tree;
    if (compact) {
        leaves.leaves = v->memory->leaves;
        leaves.leaf_ids = v->memory->ids;
    }
    const LeafList *list = compact ? &v->compacted : &v->candidates;
    while (stack.size) {
        const float far = farthest_open(p, v);
        v->candidates.count = 0;
        gather_leaves(tree, &volume, far, &stack, &v->candidates);
        if (compact) compact_triangles(tree, p, far, v);
        for (int block = 0; block < blocks; ++block) {
            if (!has_block(p, block)) continue;
            const Bundle bundle = block_bundle(p, block);
            visit_block(&leaves, &bundle, list, v->block + block);
        }
    }
}
