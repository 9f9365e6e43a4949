// The hierarchy: nodes of sixteen children, and leaves of sixteen triangles.
#ifndef LFCORE_TREE_CL
#define LFCORE_TREE_CL
#include "cut_outs.cl"

#define NODE_WIDTH 16
#define BOX 6  // lowest x, y, z, then highest
#define CORNERS 9

typedef struct {
    global const float *boxes;   // (K, BOX, 16) children of the wide nodes
    global const int *children;  // (K, 16) a node, or -1 less a leaf
    global const float *leaves;  // (L, CORNERS, 16) corners
    global const int *leaf_ids;  // (L, 16) triangles
    CutOuts cut_outs;            // those of the triangles that have holes
} Tree;

#define TREE_PARAMETERS                  \
    global const float *restrict boxes,  \
    global const int *restrict children, \
    global const float *restrict leaves, \
    global const int *restrict leaf_ids, \
    CUT_OUT_PARAMETERS
#define MAKE_TREE {boxes, children, leaves, leaf_ids, MAKE_CUT_OUTS}

// LANES triangles of a leaf, and their numbers.
inline global const float *leaf_corners(const Tree *tree, int leaf, int lane)
{
    return tree->leaves + leaf * CORNERS * NODE_WIDTH + lane;
}
inline global const int *leaf_numbers(const Tree *tree, int leaf, int lane)
{
    return tree->leaf_ids + leaf * NODE_WIDTH + lane;
}

// Leaves with their boxes: (BOX, pitch), and which they are.
typedef struct {
    global float *boxes;
    global int *leaf;
    int pitch, count;
} LeafList;
#define LIST_WORDS(pitch) ((BOX + 1) * (pitch))

inline LeafList make_list(global uint *memory, int pitch)
{
    return (LeafList){(global float *)memory, (global int *)(memory + BOX * pitch), pitch, 0};
}

inline void append_leaf(LeafList *list, global const float *box, int pitch, int leaf)
{
    const int at = list->count++;
    for (int k = 0; k < BOX; ++k) list->boxes[k * list->pitch + at] = box[k * pitch];
    list->leaf[at] = leaf;
}

// Bits of the first `count` leaves from `base` on, as far as they are a row.
inline uint listed_bits(const LeafList *list, int base)
{
    return list->count - base < LANES ? (1u << (list->count - base)) - 1u : ~0u;
}

#endif
