// Compaction: a packet of several blocks of one element keeps those triangles of the candidates
// that the packet may hit: its blocks then set up few others.
#pragma once
#include "triangles.cl"

typedef struct {
    ListedLeaves listed;
    Leaf leaves[LIST];           // of the triangles that are kept
    int ids[LIST * NODE_WIDTH];  // (LIST, NODE_WIDTH) their triangles
} CompactedLeaves;

// One element's part of the packet as if it were one block, and a block's offset from its centre.
inline Bundle element_bundle(const Packet *p, int block)
{
    return bundle_at(p->rays, centre_ray_of(p, block), p->at, p->rays->element_half_extent);
}
inline float2 block_offset(const Packet *p, int block)
{
    const Rays *r = p->rays;
    return convert_float2(r->block[block].at) + r->half_extent - r->element_half_extent;
}

// A bound of what an edge function differs by between a packet and its blocks, whose corners are
// relative to other centre rays, at rays between the edge's corners.
inline vf packet_error(const Bundle *r, Vec p, Vec q)
{
    const Vec l = absolute3(minus3(q, p));
    const vf depths = fabs(p.z + q.z) + l.z;
    const float h = 2.0f * r->half_extent;
    const float ox = fma(h, fabs(r->sx), fabs(r->ox)), dx = fma(h, fabs(r->tx), fabs(r->dx));
    const float oy = fma(h, fabs(r->sy), fabs(r->oy)), dy = fma(h, fabs(r->ty), fabs(r->dy));
    const vf x = fma(l.z, (vf)(h * fabs(r->tx)), l.x), y = fma(l.z, (vf)(h * fabs(r->ty)), l.y);
    return 2.0f * edge_error(r, p, q) +
           PACKET_ERROR * (y * fma(depths, (vf)(dx), 2.0f * (ox + x)) +
                           x * fma(depths, (vf)(dy), 2.0f * (oy + y)));
}

// Mask of LANES triangles that the packet may hit, as if it were one wide block.
inline vi packet_overlaps(const Bundle *r, global const Leaf *leaf, float z_far)
{
    Triangles t;
    vf error[3];
    const vi keep = set_up_axes(r, leaf, z_far, &t);
    if (!row_any(keep)) return keep;
    for (int k = 0; k < 3; ++k) error[k] = packet_error(r, t.v[(k + 1) % 3], t.v[(k + 2) % 3]);
    return keep & set_up_edges(r, error, &t);
}

// Append triangle `number`.  The first triangle of a leaf clears the leaf: all zero, which nothing
// can hit, in an empty box.
inline void compact_triangle(global const Leaf *from, int id, int number,
                             global CompactedLeaves *out)
{
    const int leaf = number / NODE_WIDTH, lane = number % NODE_WIDTH;
    global Leaf *to = out->leaves + leaf;
    global Boxes *boxes = out->listed.boxes + leaf / NODE_WIDTH;
    for (int axis = 0; axis < 3; ++axis) {
        global float *low = boxes->low[axis] + leaf % NODE_WIDTH;
        global float *high = boxes->high[axis] + leaf % NODE_WIDTH;
        float least = lane ? *low : FAR, most = lane ? *high : -FAR;
        for (int k = 0; k < 3; ++k) {
            const float x = from->corner[k][axis][0];
            if (lane == 0) vstore16((float16)(0.0f), 0, to->corner[k][axis]);
            to->corner[k][axis][lane] = x;
            least = min(least, x);
            most = max(most, x);
        }
        *low = least;
        *high = most;
    }
    out->ids[number] = id;
    out->listed.leaf[leaf] = leaf;
}

// Compact the candidates.  No ray hits a triangle that is left out: if rounding widens an edge onto
// a ray, the ray hits the neighbour beyond that edge.
inline LeafList compact_triangles(const Tree *tree, const Packet *p, float z_far,
                                  const LeafList *candidates, global CompactedLeaves *out)
{
    const Bundle all = element_bundle(p, 0);
    int number = 0;
    for (int k = 0; k < candidates->count; ++k)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
            const int leaf = candidates->of->leaf[k];
            global const int *ids = triangle_ids(tree, leaf, lane);
            uint bits = row_bits(packet_overlaps(&all, leaf_corners(tree, leaf, lane), z_far));
            for (; bits; bits &= bits - 1, ++number) {
                const int k = lowest(bits);
                compact_triangle(leaf_corners(tree, leaf, lane + k), ids[k], number, out);
            }
        }
    return (LeafList){&out->listed, (number + NODE_WIDTH - 1) / NODE_WIDTH};
}

// The hierarchy of compacted leaves, and whether the packet still compacts: several blocks of one
// element hit much the same triangles, but in a packet so wide that it may hit most triangles of
// its leaves it does not pay.
typedef struct { Tree leaves; int pays; global CompactedLeaves *memory; } Compaction;

inline Compaction start_compaction(const Tree *tree, const Packet *p, global CompactedLeaves *to)
{
    Compaction c = {*tree, p->rays->group_side == 1 && p->rays->blocks > 1, to};
    c.leaves.leaves = to->leaves;
    c.leaves.leaf_ids = to->ids;
    return c;
}

// A packet compacts its candidates as long as this share of their leaves or less is left.
#define MOST_COMPACTED 0.5f

// Compact the candidates if it pays; returns the hierarchy that they are leaves of.
inline const Tree *compact_candidates(const Tree *tree, const Packet *p, float z_far,
                                      Compaction *c, LeafList *candidates)
{
    if (!c->pays) return tree;
    const int all = candidates->count;
    *candidates = compact_triangles(tree, p, z_far, candidates, c->memory);
    c->pays = candidates->count < MOST_COMPACTED * all;
    return &c->leaves;
}
