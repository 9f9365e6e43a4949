// The hierarchy: nodes of sixteen children, and leaves of sixteen triangles.
#pragma once
#include "cut_outs.cl"

#define BOX 6  // lowest x, y, z, then highest
#define CORNERS 9

typedef struct {
    global const float *boxes;   // (K, BOX, 16) children of the wide nodes
    global const int *children;  // (K, 16) a node, or -1 less a leaf
    global const float *leaves;  // (L, CORNERS, 16) corners
    global const int *leaf_ids;  // (L, 16) triangles
    CutOuts cut_outs;            // those of the triangles that have holes
} Tree;

// Of a kernel's parameters.
#define MAKE_TREE                                                                             \
    {.boxes = boxes, .children = children, .leaves = leaves, .leaf_ids = leaf_ids,            \
     .cut_outs = {.of = cut_out_of, .records = cut_outs, .alpha = alpha}}

// LANES triangles of a leaf, and their numbers.
inline global const float *leaf_corners(const Tree *tree, int leaf, int lane)
{
    return tree->leaves + leaf * CORNERS * NODE_WIDTH + lane;
}
inline global const int *leaf_numbers(const Tree *tree, int leaf, int lane)
{
    return tree->leaf_ids + leaf * NODE_WIDTH + lane;
}

// Leaves with their boxes.
#define LIST 64
typedef struct {
    float boxes[BOX * LIST];  // (BOX, LIST)
    int leaf[LIST];
} ListedLeaves;
typedef struct {
    global ListedLeaves *of;
    int count;
} LeafList;
