// The walk through the hierarchy, the same for packets, shafts and single rays.
//
// Children are stored by their nearest depth, and all camera rays look along +z, so that packets
// walk front to back without sorting; single rays sort the children that they meet.
#pragma once
#include "frustum.cl"
#include "ray.cl"
#include "shaft.cl"

// The volume that a walk is for: its kind, and a Frustum, a Shaft or a Ray.
enum { FRUSTUM, SHAFT, RAY };
typedef struct { int kind; const void *of; } Volume;

// Children still to be looked at, by their places in the tree's arrays, and where each begins.
// STACK holds what a tree of MOST_LEVELS leaves there at most: all but one of each node's children.
#define STACK ((NODE_WIDTH - 1) * MOST_LEVELS + 1)
#define ROOT -1
typedef struct {
    int child[STACK];
    float near[STACK];
    int size;
} Stack;

inline void start_walk(Stack *stack)
{
    stack->child[0] = ROOT;
    stack->near[0] = 0.0f;
    stack->size = 1;
}

// Bits of the children of a node that the volume meets before `far`, and where each begins.
inline uint meet_children(const Tree *tree, const Volume *volume, int node, float far,
                          private float *near)
{
    uint bits = 0;
    for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
        global const Boxes *boxes = boxes_from(tree->boxes + node, lane);
        vi meets;
        if (volume->kind == RAY) {
            meets = ray_meets((const Ray *)volume->of, boxes, far, near + lane);
        } else {
            if (volume->kind == SHAFT) meets = shaft_meets((const Shaft *)volume->of, boxes);
            else meets = frustum_meets((const Frustum *)volume->of, boxes, far);
            VSTORE(VLOAD(boxes->low[2]), near + lane);
        }
        bits |= row_bits(meets) << lane;
    }
    return bits;
}

// Put children on the stack, the nearest on top.
inline void push_children(const Volume *volume, int node, uint bits, private const float *near,
                          Stack *stack)
{
    const int base = stack->size;
    while (bits) {
        const uint lane = 31 - clz(bits);
        bits ^= 1u << lane;
        int at = stack->size++;
        for (; volume->kind == RAY && at > base && stack->near[at - 1] < near[lane]; --at) {
            stack->near[at] = stack->near[at - 1];
            stack->child[at] = stack->child[at - 1];
        }
        stack->near[at] = near[lane];
        stack->child[at] = node * NODE_WIDTH + lane;
    }
}

// The next leaf that the volume meets before `far`, as a child's place; ROOT once none is left.
inline int next_leaf(const Tree *tree, const Volume *volume, float far, Stack *stack)
{
    private float near[NODE_WIDTH];
    while (stack->size) {
        const int child = stack->child[--stack->size];
        if (stack->near[stack->size] > far) continue;
        const int node = child == ROOT ? 0 : tree->children[child];
        if (node < 0) return child;
        const uint bits = meet_children(tree, volume, node, far, near);
        push_children(volume, node, bits, near, stack);
    }
    return ROOT;
}

// List leaves until the list is full or none is left, which an empty stack tells.
inline void gather_leaves(const Tree *tree, const Volume *volume, float far, Stack *stack,
                          LeafList *list)
{
    while (list->count < LIST) {
        const int child = next_leaf(tree, volume, far, stack);
        if (child == ROOT) return;
        const int at = list->count++;
        global const Boxes *from = boxes_from(tree->boxes + child / NODE_WIDTH, child % NODE_WIDTH);
        global Boxes *to = list->of->boxes + at / NODE_WIDTH;
        for (int k = 0; k < 3; ++k) {
            to->low[k][at % NODE_WIDTH] = from->low[k][0];
            to->high[k][at % NODE_WIDTH] = from->high[k][0];
        }
        list->of->leaf[at] = -1 - tree->children[child];
    }
}

// The first triangle that a ray meets, if that is nearer than hit->t.
inline void closest_hit(const Tree *tree, const Ray *r, Hit *hit)
{
    const Volume volume = {RAY, r};
    Stack stack;
    start_walk(&stack);
    for (;;) {
        const int child = next_leaf(tree, &volume, hit->t * RAY_SLACK, &stack);
        if (child == ROOT) return;
        const int leaf = -1 - tree->children[child];
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
            hit_leaf(tree, r, leaf, lane, hit);
    }
}
