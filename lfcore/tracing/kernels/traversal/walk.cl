// The hierarchy, nodes of sixteen children and leaves of sixteen triangles, and walks through it.
// Children are stored by their nearest depth, and camera rays look along +z, so packets walk front
// to back without sorting; single rays sort the children that they hit.
//
// Source of packets that traverse by their bounds: A. Reshetov, A. Soupikov, J. Hurley, "Multi-
// Level Ray Tracing Algorithm", SIGGRAPH 2005; of packets: I. Wald et al., "Interactive Rendering
// with Coherent Ray Tracing", Eurographics 2001.
#pragma once
#include "alpha_test.cl"
#include "ray.cl"

typedef struct {
    global const Boxes *boxes;   // (K,) of the wide nodes' children
    global const int *children;  // (K, 16) a node, or -1 - a leaf
    global const Leaf *leaves;   // (L,)
    global const int *leaf_ids;  // (L, 16) triangles
    AlphaTests alpha_tests;      // of triangles with holes
} Tree;

// The numbers of a leaf's triangles from `lane` on.
inline global const int *triangle_ids(const Tree *tree, int leaf, int lane)
{
    return tree->leaf_ids + leaf * NODE_WIDTH + lane;
}

// Candidates: leaves with their boxes.
#define LIST 64
typedef struct { Boxes boxes[LIST / NODE_WIDTH]; int leaf[LIST]; } ListedLeaves;
typedef struct { global ListedLeaves *leaves; int count; } LeafList;

// A frustum: the intervals of x and of y, at depth z, that a set of rays reaches,
//     [o_lo + z d_lo - |h + z g| - |hu + z gu|, o_hi + z d_hi + |h + z g| + |hu + z gu|]
// of the centre ray o + z d, widened by rounding errors, and half extents h + z g (inner grid), hu +
// z gu (a block's elements).
// The upper bound is convex in z, the lower one concave: the ends of a box's depth range suffice.
typedef struct { float o_lo, o_hi, d_lo, d_hi, h, g; } Interval;
typedef struct { Interval x, y; float hu, gu; } Frustum;

inline Interval make_interval(float o, float d, float h, float g, float hu, float gu)
{
    const float near = FRUSTUM_SLACK * (fabs(o) + fabs(h) + fabs(hu));
    const float far = FRUSTUM_SLACK * (fabs(d) + fabs(g) + fabs(gu));
    return (Interval){.o_lo = o - near, .o_hi = o + near, .d_lo = d - far, .d_hi = d + far,
                      .h = h, .g = g};
}

// The frustum of the rays of a bundle.
inline Frustum make_frustum(const Bundle *r)
{
    const float n = r->half_extent, hu = OUTER_HALF * r->a, gu = OUTER_HALF * r->b;
    return (Frustum){make_interval(r->ox, r->dx, n * r->sx, n * r->tx, hu, gu),
                     make_interval(r->oy, r->dy, n * r->sy, n * r->ty, hu, gu), hu, gu};
}

// Half the extent along an axis at depth z.
inline vf half_span(vf z, float h, float g, float hu, float gu)
{
    const vf inner = fabs(fma(z, (vf)(g), (vf)(h)));
    return OUTER > 1 ? inner + fabs(fma(z, (vf)(gu), (vf)(hu))) : inner;
}

// Mask of boxes that lie beside an interval at both ends of their depths.
inline vi beside_interval(const Frustum *f, const Interval *a, vf lo, vf hi, vf z0, vf z1)
{
    const vf w0 = half_span(z0, a->h, a->g, f->hu, f->gu);
    const vf w1 = half_span(z1, a->h, a->g, f->hu, f->gu);
    const vf d_hi = a->d_hi, d_lo = a->d_lo;
    return GT(lo, max(fma(z0, d_hi, a->o_hi + w0), fma(z1, d_hi, a->o_hi + w1))) |
           LT(hi, min(fma(z0, d_lo, a->o_lo - w0), fma(z1, d_lo, a->o_lo - w1)));
}

// Mask of LANES boxes, from `lane` on, that the frustum may overlap nearer than z_far.
inline vi frustum_overlaps(const Frustum *f, global const Boxes *boxes, int lane, float z_far)
{
    const Ranges b = box_ranges(boxes, lane);
    const vf z_lo = b.low[2], z1 = b.high[2], z0 = max(z_lo, (vf)(0.0f));
    return ~(beside_interval(f, &f->x, b.low[0], b.high[0], z0, z1) |
             beside_interval(f, &f->y, b.low[1], b.high[1], z0, z1) |
             LE(z1, (vf)(0.0f)) | GT(z_lo, (vf)(z_far)));
}

// The volume of a walk, a frustum or a sweep.  Only single rays need `sorted` leaves; they are
// `oblique` if they are parallel to no side of a box.
typedef struct { const Frustum *frustum; const Sweep *sweep; int sorted, oblique; } Volume;

// The children to visit.  An entry has the depth at which a child begins in its upper half (the
// bits of a float, which compare as floats unless both are negative) and the child's index in the
// lower.  Each level adds at most NODE_WIDTH - 1 entries.
#define STACK ((NODE_WIDTH - 1) * MOST_LEVELS + 1)
#define ROOT -1
typedef struct { long entry[STACK]; int size; } Stack;

inline void start_walk(Stack *stack)
{
    stack->entry[0] = (uint)ROOT;
    stack->size = 1;
}

// Bits of a node's children that the volume overlaps before `far`, and the depths at which they
// begin.
inline uint overlapping_children(const Tree *tree, const Volume *volume, int node, float far,
                          private float *near)
{
    vi overlapped = 0;
    for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
        global const Boxes *boxes = tree->boxes + node;
        vf begin = VLOAD(boxes->low[2] + lane);
        const vi overlaps =
            volume->oblique ? ray_overlaps(volume->sweep, boxes, lane, far, &begin)
            : volume->sweep ? sweep_overlaps(volume->sweep, boxes, lane, far, &begin)
                            : frustum_overlaps(volume->frustum, boxes, lane, far);
        VSTORE(begin, near + lane);
        overlapped |= overlaps & (LANE_BITS << lane);
    }
    return row_or(overlapped);
}

// Put children on the stack, the nearest on top.
inline void push_children(const Volume *volume, int node, uint bits, private const float *near,
                          Stack *stack)
{
    const int base = stack->size;
    while (bits) {
        const uint lane = 31 - clz(bits);
        bits ^= 1u << lane;
        const long child = upsample(as_int(near[lane]), (uint)(node * NODE_WIDTH + lane));
        int at = stack->size++;
        for (; volume->sorted && at > base && stack->entry[at - 1] < child; --at)
            stack->entry[at] = stack->entry[at - 1];
        stack->entry[at] = child;
    }
}

// The next leaf, from the stack, that the volume overlaps before `far`; -1 once none is left.
inline int next_leaf(const Tree *tree, const Volume *volume, float far, Stack *stack)
{
    private float near[NODE_WIDTH];
    while (stack->size) {
        const long top = stack->entry[--stack->size];
        if ((int)(top >> 32) > as_int(far)) continue;
        const int child = (int)top, node = child == ROOT ? 0 : tree->children[child];
        if (node < 0) return -1 - node;
        const uint bits = overlapping_children(tree, volume, node, far, near);
        push_children(volume, node, bits, near, stack);
    }
    return -1;
}

// The child that next_leaf has just taken from the stack.
inline int taken_child(const Stack *stack) { return (int)stack->entry[stack->size]; }

// List leaves until the list is full or the stack is empty.
inline void gather_leaves(const Tree *tree, const Volume *volume, float far, Stack *stack,
                          LeafList *list)
{
    for (int leaf; list->count < LIST && (leaf = next_leaf(tree, volume, far, stack)) >= 0;) {
        const int at = list->count++, child = taken_child(stack);
        global const Boxes *from = tree->boxes + child / NODE_WIDTH;
        global Boxes *to = list->leaves->boxes + at / NODE_WIDTH;
        for (int k = 0; k < 3; ++k) {
            to->low[k][at % NODE_WIDTH] = from->low[k][child % NODE_WIDTH];
            to->high[k][at % NODE_WIDTH] = from->high[k][child % NODE_WIDTH];
        }
        list->leaves->leaf[at] = leaf;
    }
}
