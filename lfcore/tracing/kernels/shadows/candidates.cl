// What shadows are asked of: rays that face a light, and the leaves between them and it.
#ifndef LFCORE_CANDIDATES_CL
#define LFCORE_CANDIDATES_CL
#include "occluders.cl"

// A worker's memory for shadows, and what they are of.
typedef struct {
    const Tree *tree;
    const Scene *scene;
    const Packet *packet;
    global int *open;        // scratch: (2, BLOCK_RAYS)
    global float *seen;      // scratch: (3, BLOCK_RAYS)
    struct OccluderCache *cache;
    global PlaneEquations *element_planes;  // scratch: of one triangle
} Shadows;

// Seventeen roundings of the terms of a hit point.
#define HIT_SLACK (17.0f * ROUNDING)

inline global const float *shadow_light(const Scene *s, int number)
{
    return s->lights + (s->numbers->open_lights + number) * LIGHT;
}

// Mask of the rays that meet a side which faces the light, and before which the light shines, in
// the row that begins with ray `at`.
inline vi facing_row(const Samples *s, global const float *light, int at)
{
    const vi met = GE(VLOAD(s->key + at), (vi)(0));
    Vec towards = spread3(light_vector(light));
    if (is_point(light)) towards = minus3(towards, load3(s->point, at));
    const vi facing = met & GT(dot3(load3(s->normal, at), towards), (vf)(0.0f));
    const float3 forward = emitter_normal(light);
    if (!any(forward != 0.0f)) return facing;
    return facing & LT(dot3(spread3(forward), towards), (vf)(0.0f));
}

inline void clear_lit(global int *lit)
{
    for (int row = 0; row < BLOCK; row += LANES) VSTORE((vi)(0), lit + row);
}

// The next leaf that reaches into a light's shaft; -1 once none is left.
inline int next_in_shaft(const Tree *tree, const Shaft *shaft, Stack *stack)
{
    const Volume volume = {0, shaft, 0};
    const int child = next_leaf(tree, &volume, FAR, stack);
    return child == ROOT ? -1 : -1 - tree->children[child];
}

#endif
