// Which triangle each ray of a packet meets first.
//
// The packet walks the hierarchy as one, front to back.  Leaves are collected in a list of
// candidates; every block culls the list by its own, narrower frustum, and triangles by their edge
// functions.  Nodes behind the farthest visible depth are dropped.
#pragma once
#include "camera_rays.cl"
#include "compaction.cl"

// A packet compacts its candidates as long as this share of their leaves or less is left.
#define MOST_COMPACTED 0.5f

// A worker's own memory.
typedef struct {
    DepthBuffer buffers[MOST_BLOCKS];
    ListedLeaves candidates;
    CompactedLeaves compacted;
} VisibilityMemory;

typedef struct {
    Coverage block[MOST_BLOCKS];
    global VisibilityMemory *memory;
} Visibility;

// Test one block against a leaf.  Triangles that cover the block come first: often nothing is
// before them, and no depth buffer is needed.
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
    if (!changed) return;
    vf far = VLOAD(c->z);
    for (int at = LANES; at < BLOCK_RAYS; at += LANES) far = max(far, VLOAD(c->z + at));
    c->z_far = min(row_max(far), FAR);
}

inline void visit_block(const Tree *tree, const Bundle *bundle, const LeafList *list, Coverage *c)
{
    const Frustum frustum = make_frustum(bundle, bundle);
    for (int base = 0; base < list->count; base += LANES) {
        const int left = list->count - base;
        const uint listed = left < LANES ? (1u << left) - 1u : ~0u;
        global const Boxes *boxes = boxes_from(list->of->boxes + base / NODE_WIDTH,
                                               base % NODE_WIDTH);
        const vi meets = frustum_overlaps(&frustum, boxes, c->z_far);
        for (uint bits = row_bits(meets) & listed; bits; bits &= bits - 1) {
            const int k = lowest(bits);
            if (boxes->low[2][k] > c->z_far) continue;
            visit_leaf(tree, bundle, list->of->leaf[base + k], c);
        }
    }
}

inline void find_visible(const Tree *tree, const Packet *p, Visibility *v)
{
    const int blocks = p->rays->blocks;
    for (int block = 0; block < blocks; ++block)
        clear_coverage(v->memory->buffers + block, p->rays->half_extent, v->block + block);
    if (SINGLE_RAYS) {
        follow_packet(tree, p, v->block);
        return;
    }
    const Frustum frustum = packet_frustum(p);
    const Volume volume = {&frustum, 0};
    Stack stack;
    start_walk(&stack);
    // Several blocks of one element hit much the same triangles.  Compaction does not pay in a
    // packet so wide that it may hit most triangles of its leaves.
    int compact = p->rays->group == 1 && blocks > 1;
    Tree compacted = *tree;
    compacted.leaves = v->memory->compacted.leaves;
    compacted.leaf_ids = v->memory->compacted.ids;
    while (stack.size) {
        float far = 0.0f;  // beyond which no block can hit anything
        for (int block = 0; block < blocks; ++block)
            if (has_block(p, block)) far = max(far, v->block[block].z_far);
        LeafList list = {&v->memory->candidates, 0};
        gather_leaves(tree, &volume, far, &stack, &list);
        const Tree *leaves = compact ? &compacted : tree;
        if (compact) {
            const int all = list.count;
            list = compact_triangles(tree, p, far, &list, &v->memory->compacted);
            compact = list.count < MOST_COMPACTED * all;
        }
        for (int block = 0; block < blocks; ++block) {
            if (!has_block(p, block)) continue;
            const Bundle bundle = block_bundle(p, block);
            visit_block(leaves, &bundle, &list, v->block + block);
        }
    }
}

// A region is what one triangle has of a block: the triangle, a mask of sixteen rays for each of
// sixteen rows, and the rectangle around them.  A covered block is one full region.  Later stages
// know a block by its regions alone.
typedef struct {
    int triangle;
    int rows[BLOCK];  // a bit for each ray of a row
    int columns;      // a bit for each column that holds any
    int top, bottom;  // first and last row that hold any
} Region;

typedef struct {
    global Region *of;  // (BLOCK_RAYS,) in the order of their first rays
    int count;
} Regions;

// Columns of a block's row that lie in the inner grid, and whether a row does.
inline int open_columns(int2 inside)
{
    int open = 0;
    for (int k = 0; k < OUTER; ++k) open |= ((1 << inside.x) - 1) << (k * INNER);
    return open;
}
inline int open_row(int row, int2 inside) { return row % INNER < inside.y; }

inline global Region *add_region(Regions *regions, int triangle)
{
    global Region *r = regions->of + regions->count++;
    r->triangle = triangle;
    for (int row = 0; row < BLOCK; row += LANES) VSTORE((vi)(0), r->rows + row);
    r->columns = 0;
    r->top = BLOCK;
    return r;
}

inline void add_rays(global Region *r, int row, int rays)
{
    if (!rays) return;
    r->rows[row] |= rays;
    r->columns |= rays;
    r->top = min(r->top, row);
    r->bottom = row;
}

// Regions by the numbers of their triangles, of which there may be as many as rays.
#define TABLE (2 * BLOCK_RAYS)
inline global Region *find_region(private int *table, int triangle, Regions *regions)
{
    int slot = triangle % TABLE;
    for (; table[slot] >= 0; slot = (slot + 1) % TABLE)
        if (regions->of[table[slot]].triangle == triangle) return regions->of + table[slot];
    table[slot] = regions->count;
    return add_region(regions, triangle);
}

// Sort a depth buffer's rays by their triangles.
inline void sort_rays(const Coverage *c, int open, int2 inside, Regions *out)
{
    private int table[TABLE];
    for (int k = 0; k < TABLE; k += LANES) VSTORE((vi)(-1), table + k);
    global Region *last = 0;
    for (int row = 0; row < BLOCK; ++row) {
        if (!open_row(row, inside)) continue;
        for (int column = 0; column < BLOCK; column += LANES) {
            global const int *ids = c->ids + row * BLOCK + column;
            const vi triangles = VLOAD(ids);
            uint left = row_bits(GE(triangles, (vi)(0))) & (uint)open >> column;
            while (left) {
                const int triangle = ids[lowest(left)];
                const uint rays = row_bits(EQ(triangles, (vi)(triangle))) & left;
                left &= ~rays;
                if (!last || last->triangle != triangle) last = find_region(table, triangle, out);
                add_rays(last, row, rays << column);
            }
        }
    }
}

// The regions of a block, of which only `inside` columns and rows of the inner grid count.
inline void find_regions(const Coverage *c, int2 inside, Regions *out)
{
    out->count = 0;
    if (c->covering_triangle == NOTHING) return;
    const int open = open_columns(inside);
    if (c->covering_triangle == BUFFERED) {
        sort_rays(c, open, inside, out);
        return;
    }
    global Region *all = add_region(out, c->covering_triangle);
    for (int row = 0; row < BLOCK; ++row) all->rows[row] = open_row(row, inside) ? open : 0;
    all->columns = open;
    all->top = 0;
    all->bottom = BLOCK - INNER + inside.y - 1;
}

// Mask of a region's rays in the row of LANES that begins with ray `at`.
inline vi region_row(global const Region *r, int at)
{
    return mask_of_bits(r->rows[at / BLOCK] >> at % BLOCK);
}
