// The first triangle that each ray of a packet hits.
//
// A packet walks the hierarchy once, front to back, to the farthest visible depth, and lists
// candidates.  Every block culls candidates by its frustum, and triangles by their edge functions.
#pragma once
#include "camera_rays.cl"

// A worker's own memory.
typedef struct {
    DepthBuffer buffers[MOST_BLOCKS];
    ListedLeaves candidates;
} VisibilityMemory;

typedef struct { Coverage block[MOST_BLOCKS]; global VisibilityMemory *memory; } Visibility;

// Merge a leaf's triangles into a block's depth buffer.
inline void visit_leaf(const Tree *tree, const Bundle *bundle, int leaf, Coverage *c)
{
    Triangles t;
    int changed = 0;
    for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
        global const int *ids = triangle_ids(tree, leaf, lane);
        set_up_triangles(bundle, tree->leaves + leaf, lane, c->z_far, &t);
        for (uint keep = t.keep; keep; keep &= keep - 1) {
            const uint k = lowest(keep);
            if (t.near[k] > c->z_far) continue;
            changed |= hit_triangle(&t, k, ids[k], bundle, &tree->alpha_tests, c);
        }
    }
    if (!changed) return;
    vf far = VLOAD(c->z);
    for (int at = LANES; at < BLOCK_RAYS; at += LANES) far = max(far, VLOAD(c->z + at));
    c->z_far = min(row_max(far), FAR);
}

inline void visit_block(const Tree *tree, const Bundle *bundle, const LeafList *list, Coverage *c)
{
    const Frustum frustum = make_frustum(bundle);
    for (int base = 0; base < list->count; base += LANES) {
        const int left = list->count - base;
        const uint listed = left < LANES ? (1u << left) - 1u : ~0u;
        global const Boxes *boxes = list->leaves->boxes + base / NODE_WIDTH;
        const int lane = base % NODE_WIDTH;
        const vi overlaps = frustum_overlaps(&frustum, boxes, lane, c->z_far);
        for (uint bits = row_bits(overlaps) & listed; bits; bits &= bits - 1) {
            const int k = lowest(bits);
            if (boxes->low[2][lane + k] > c->z_far) continue;
            visit_leaf(tree, bundle, list->leaves->leaf[base + k], c);
        }
    }
}

inline void find_visible(const Tree *tree, const Packet *p, Visibility *v)
{
    const int blocks = p->rays->blocks;
    for (int block = 0; block < blocks; ++block)
        clear_coverage(v->memory->buffers + block, v->block + block);
    if (SINGLE_RAYS) {
        follow_packet(tree, p, v->block);
        return;
    }
    const Frustum frustum = packet_frustum(p);
    const Volume volume = {.frustum = &frustum};
    Stack stack;
    start_walk(&stack);
    while (stack.size) {
        float z_far = 0.0f;  // the farthest depth of a possible hit
        for (int block = 0; block < blocks; ++block)
            if (has_block(p, block)) z_far = max(z_far, v->block[block].z_far);
        LeafList list = {&v->memory->candidates, 0};
        gather_leaves(tree, &volume, z_far, &stack, &list);
        for (int block = 0; block < blocks; ++block) {
            if (!has_block(p, block)) continue;
            const Bundle bundle = block_bundle(p, block);
            visit_block(tree, &bundle, &list, v->block + block);
        }
    }
}

// A region: the rays of a block that hit one triangle.  Surfaces and shadows use only regions.
typedef struct {
    int triangle;
    int rows[BLOCK];  // a bit for each ray of a row
    int columns;      // a bit per column with rays
    int top, bottom;  // first and last row with rays
} Region;

#define RAY_ROWS (BLOCK_RAYS / LANES)
typedef struct {
    global Region *region;  // (BLOCK_RAYS,) in the order of their first rays
    int count;
    uchar row_count[RAY_ROWS], row_regions[RAY_ROWS][LANES];  // those in each row of LANES rays
} Regions;

// Columns of a block's row that lie in the inner grid, and whether a row does.
inline int columns_inside(int2 inside)
{
    int columns = 0;
    for (int k = 0; k < OUTER; ++k) columns |= ((1 << inside.x) - 1) << (k * INNER);
    return columns;
}
inline int row_inside(int row, int2 inside) { return row % INNER < inside.y; }

inline global Region *add_region(Regions *regions, int triangle)
{
    global Region *r = regions->region + regions->count++;
    *r = (Region){triangle, .top = BLOCK};
    return r;
}

inline void add_rays(global Region *r, int row, int rays)
{
    r->rows[row] |= rays;
    r->columns |= rays;
    r->top = min(r->top, row);
    r->bottom = row;
}

// Find or add the region of a triangle, by a hash table of twice the largest number of regions.
#define TABLE (2 * BLOCK_RAYS)
inline int find_region(private int *table, int triangle, Regions *regions)
{
    int entry = triangle % TABLE;
    for (int tried = 0; tried < TABLE && table[entry] >= 0; ++tried, entry = (entry + 1) % TABLE)
        if (regions->region[table[entry]].triangle == triangle) return table[entry];
    table[entry] = regions->count;
    add_region(regions, triangle);
    return table[entry];
}

// The regions of a block: the depth buffer's rays, grouped by triangle.  Only the `inside` columns
// and rows are in the inner grid.
inline void find_regions(const Coverage *c, int2 inside, Regions *out)
{
    const int columns = columns_inside(inside);
    out->count = 0;
    private int table[TABLE];
    for (int k = 0; k < TABLE; k += LANES) VSTORE((vi)(-1), table + k);
    int last = -1, k = -1;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const int row = at / BLOCK, column = at % BLOCK;
        const vi triangles = VLOAD(c->ids + at);
        uint left = row_bits(GE(triangles, (vi)(0))) & (uint)columns >> column;
        out->row_count[at / LANES] = 0;
        while (left && row_inside(row, inside)) {
            const int triangle = c->ids[at + lowest(left)];
            const uint rays = row_bits(EQ(triangles, (vi)(triangle))) & left;
            left &= ~rays;
            if (triangle != last) k = find_region(table, last = triangle, out);
            add_rays(out->region + k, row, rays << column);
            out->row_regions[at / LANES][out->row_count[at / LANES]++] = k;
        }
    }
}

// Mask of a region's rays in the row of LANES that begins with ray `at`.
inline vi region_row(global const Region *r, int at)
{
    return mask_of_bits(r->rows[at / BLOCK] >> at % BLOCK);
}
