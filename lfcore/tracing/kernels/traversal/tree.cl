// The hierarchy: nodes of sixteen children, and leaves of sixteen triangles.
#pragma once
#include "block.cl"

// 1 where a scene has textures, or triangles with holes.
#define TEXTURED ((TEXTURES & TEXTURED_BIT) != 0)
#define CUT_OUTS ((TEXTURES & CUT_OUTS_BIT) != 0)

typedef struct {
    global const int *of;          // (T,) a triangle's record; -1: no holes
    global const CutOut *records;  // (C,)
    global const uchar *alpha;     // pictures of codes
} CutOuts;

inline int has_holes(const CutOuts *c, int triangle) { return CUT_OUTS && c->of[triangle] >= 0; }

typedef struct {
    global const Boxes *boxes;   // (K,) of the wide nodes' children
    global const int *children;  // (K, 16) a node, or -1 less a leaf
    global const Leaf *leaves;   // (L,)
    global const int *leaf_ids;  // (L, 16) triangles
    CutOuts cut_outs;            // those of the triangles that have holes
} Tree;

// Of a kernel's parameters.
#define MAKE_TREE                                                                             \
    {.boxes = boxes, .children = children, .leaves = leaves, .leaf_ids = leaf_ids,            \
     .cut_outs = {.of = cut_out_of, .records = cut_outs, .alpha = alpha}}

// Records of 16 boxes or triangles from `lane` on: element 0 of each array is that lane.
inline global const Boxes *boxes_from(global const Boxes *boxes, int lane)
{
    return (global const Boxes *)(boxes->low[0] + lane);
}
inline global const Leaf *leaf_corners(const Tree *tree, int leaf, int lane)
{
    return (global const Leaf *)(tree->leaves[leaf].corner[0][0] + lane);
}
inline global const int *leaf_numbers(const Tree *tree, int leaf, int lane)
{
    return tree->leaf_ids + leaf * NODE_WIDTH + lane;
}

// Leaves with their boxes.
#define LIST 64
typedef struct {
    Boxes boxes[LIST / NODE_WIDTH];
    int leaf[LIST];
} ListedLeaves;
typedef struct {
    global ListedLeaves *of;
    int count;
} LeafList;
