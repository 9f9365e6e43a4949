// Compaction: a packet of several blocks of one element keeps those triangles of the candidates
// that the packet may hit, so that its blocks set up few others.
#pragma once
#include "triangles.cl"

typedef struct {
    ListedLeaves listed;
    Leaf leaves[LIST];           // of the triangles that are kept
    int ids[LIST * NODE_WIDTH];  // (LIST, NODE_WIDTH) their triangles
} CompactedLeaves;

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

// Compact the candidates as if the packet were one wide block.  No ray hits a triangle that is left
// out: if rounding widens an edge onto a ray, the ray hits the neighbour beyond that edge.
inline LeafList compact_triangles(const Tree *tree, const Packet *p, float z_far,
                                  const LeafList *candidates, global CompactedLeaves *out)
{
    const Bundle all = element_bundle(p, 0);
    int number = 0;
    for (int k = 0; k < candidates->count; ++k)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
            const int leaf = candidates->of->leaf[k];
            global const Leaf *corners = leaf_corners(tree, leaf, lane);
            global const int *ids = leaf_numbers(tree, leaf, lane);
            Placed placed;
            uint bits = row_bits(place_triangles(&all, corners, z_far, 1, &placed));
            for (; bits; bits &= bits - 1, ++number) {
                const int k = lowest(bits);
                compact_triangle(leaf_corners(tree, leaf, lane + k), ids[k], number, out);
            }
        }
    return (LeafList){&out->listed, (number + NODE_WIDTH - 1) / NODE_WIDTH};
}
