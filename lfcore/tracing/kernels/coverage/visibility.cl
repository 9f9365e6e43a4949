// Which triangle each ray of a packet meets first.
//
// The packet walks the hierarchy as one, front to back.  Leaves are gathered in a list; every block
// then culls the list by its own, narrower frustum, and triangles by their edge functions.  Nodes
// behind the farthest visible depth are dropped.
#ifndef LFCORE_VISIBILITY_CL
#define LFCORE_VISIBILITY_CL
#include "depth_buffer.cl"
#include "walk.cl"

// A worker's own memory.  Packed leaves are of the triangles that the packet may meet.
typedef struct {
    DepthBuffer buffers[MOST_BLOCKS];
    ListedLeaves gathered, packed;
    float corners[LIST * CORNERS * NODE_WIDTH];  // (LIST, CORNERS, NODE_WIDTH) of packed leaves
    int ids[LIST * NODE_WIDTH];                  // (LIST, NODE_WIDTH)
} VisibilityMemory;

// The packet's blocks, and the leaves in their way.
typedef struct {
    Coverage block[MOST_BLOCKS];
    LeafList gathered, packed;
    global VisibilityMemory *memory;
} Visibility;

inline void start_visibility(const Rays *rays, global VisibilityMemory *memory, Visibility *v)
{
    for (int block = 0; block < rays->blocks; ++block)
        clear_coverage(memory->buffers + block, rays->extent, v->block + block);
    v->gathered.of = &memory->gathered;
    v->packed.of = &memory->packed;
    v->memory = memory;
}

// Put triangle `number` of the packed ones in its place.  Before the first of a leaf comes, its
// triangles are such as nothing meets, in an empty box.
inline void pack_triangle(global const float *from, int id, int number, Visibility *v)
{
    const int leaf = number / NODE_WIDTH, lane = number % NODE_WIDTH;
    global float *to = v->memory->corners + leaf * CORNERS * NODE_WIDTH;
    global float *box = v->packed.of->boxes + leaf;
    for (int k = 0; lane == 0 && k < CORNERS; ++k) vstore16((float16)(0.0f), k, to);
    for (int k = 0; lane == 0 && k < BOX; ++k) box[k * LIST] = k < 3 ? FAR : -FAR;
    for (int k = 0; k < CORNERS; ++k) {
        const float x = from[k * NODE_WIDTH];
        global float *lo = box + k % 3 * LIST, *hi = lo + 3 * LIST;
        to[k * NODE_WIDTH + lane] = x;
        *lo = min(*lo, x);
        *hi = max(*hi, x);
    }
    v->memory->ids[number] = id;
    v->packed.of->leaf[leaf] = leaf;
    v->packed.count = leaf + 1;
}

// Pack the gathered triangles that a packet of one element may meet, as one wide block does: its
// blocks then set up few that they do not meet.  No ray meets what is left out, rounding allowed
// for: where an edge of it is widened onto a ray, the ray meets the triangle beyond that edge.
inline void pack_triangles(const Tree *tree, const Packet *p, float z_far, Visibility *v)
{
    const Bundle all = element_bundle(p, 0);
    int number = 0;
    v->packed.count = 0;
    for (int k = 0; k < v->gathered.count; ++k)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
            const int leaf = v->gathered.of->leaf[k];
            global const float *corners = leaf_corners(tree, leaf, lane);
            global const int *ids = leaf_numbers(tree, leaf, lane);
            Placed placed;
            uint bits = row_bits(place_triangles(&all, corners, z_far, &placed));
            for (; bits; bits &= bits - 1, ++number)
                pack_triangle(corners + lowest(bits), ids[lowest(bits)], number, v);
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
            if (settle_cover(&t, k, ids[k], c)) t.keep ^= 1u << k;
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
        const vi meets = frustum_meets(&frustum, list->of->boxes + base, LIST, c->z_far);
        for (uint bits = row_bits(meets) & listed; bits; bits &= bits - 1) {
            const int slot = base + lowest(bits);
            if (list->of->boxes[2 * LIST + slot] > c->z_far) continue;
            visit_leaf(tree, bundle, list->of->leaf[slot], c);
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
        const float x = i - r->extent, y = j - r->extent;
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
    const int blocks = p->rays->blocks;
    for (int block = 0; SINGLE_RAYS && block < blocks; ++block) {
        if (!has_block(p, block)) continue;
        const Bundle bundle = block_bundle(p, block);
        follow_rays(tree, &bundle, block_inside(p, block), v->block + block);
    }
    if (SINGLE_RAYS) return;
    const Frustum frustum = packet_frustum(p);
    const Volume volume = {&frustum, 0, 0};
    Stack stack;
    start_walk(&stack);
    // Several blocks of one element meet much the same triangles.
    const int pack = p->rays->group == 1 && blocks > 1;
    Tree leaves = *tree;
    if (pack) {
        leaves.leaves = v->memory->corners;
        leaves.leaf_ids = v->memory->ids;
    }
    const LeafList *list = pack ? &v->packed : &v->gathered;
    while (stack.size) {
        const float far = farthest_open(p, v);
        v->gathered.count = 0;
        gather_leaves(tree, &volume, far, &stack, &v->gathered);
        if (pack) pack_triangles(tree, p, far, v);
        for (int block = 0; block < blocks; ++block) {
            if (!has_block(p, block)) continue;
            const Bundle bundle = block_bundle(p, block);
            visit_block(&leaves, &bundle, list, v->block + block);
        }
    }
}

#endif
