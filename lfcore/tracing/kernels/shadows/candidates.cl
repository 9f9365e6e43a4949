// Shadow candidates: the leaves that may stand between a light and what a packet sees.
//
// They are listed for each light that casts shadows when it is first asked for.
#ifndef LFCORE_CANDIDATES_CL
#define LFCORE_CANDIDATES_CL
#include "occluders.cl"

#define CANDIDATES 512
#define CANDIDATE_WORDS LIST_WORDS(CANDIDATES)

enum { NOT_ASKED = -1, TOO_MANY = -2 };  // or their number

// A worker's memory for shadows, and what they are of.
typedef struct {
    const Tree *tree;
    const Scene *scene;
    const Packet *packet;
    const Visibility *visibility;
    global uint *lists;      // (shadow lights, CANDIDATE_WORDS)
    global int *listed;      // (shadow lights,) how many each list holds
    int bounded;             // whether `seen_box` is known
    Box seen_box;            // of all that the packet sees; lo > hi if that is nothing
    LeafList nearby;         // scratch: leaves near a set of shadow rays
    global int *open;        // scratch: (2, BLOCK_RAYS)
    global float *seen;      // scratch: (3, BLOCK_RAYS)
    struct OccluderCache *cache;
    global PlaneEquations *element_planes;  // scratch: of one triangle
} Shadows;

// Seventeen roundings of the terms of a hit point.
#define HIT_SLACK (17.0f * ROUNDING)

// Bounds of everything that the packet sees.  The ends of a block's depths bound it, along x, then
// y.
inline void bound_packet(Shadows *s)
{
    const Rays *rays = s->packet->rays;
    const float4 origin_step = rays->step.xxyy, slope_step = rays->step.zzww;
    const float4 wide_origin = HALF * fabs(origin_step) + OUTER_HALF * fabs(rays->outer.x);
    const float4 wide_slope = HALF * fabs(slope_step) + OUTER_HALF * fabs(rays->outer.y);
    float4 least = FAR, most = -FAR;
    float near = FAR, far = -FAR;
    for (int block = 0; block < PACKET_BLOCKS; ++block) {
        if (!has_block(s->packet, block)) continue;
        const float2 seen = seen_depths(s->visibility->block + block);
        if (!(seen.x <= seen.y)) continue;
        const Bundle r = block_bundle(s->packet, block);
        const float4 depth = seen.xyxy, origin = (float4)(r.ox, r.ox, r.oy, r.oy);
        const float4 slope = (float4)(r.dx, r.dx, r.dy, r.dy), middle = fma(depth, slope, origin);
        const float4 inner = HALF * fabs(fma(depth, slope_step, origin_step));
        const float4 outer = OUTER_HALF * fabs(fma(depth, (float4)(r.b), (float4)(r.a)));
        const float4 size = fma(depth, fabs(slope) + wide_slope, fabs(origin) + wide_origin);
        const float4 half_width = inner + outer + HIT_SLACK * size;
        least = min(least, middle - half_width);
        most = max(most, middle + half_width);
        near = min(near, seen.x);
        far = max(far, seen.y);
    }
    const Box box = {{min(least.x, least.y), min(least.z, least.w), near},
                     {max(most.x, most.y), max(most.z, most.w), far}};
    s->seen_box = box;
    s->bounded = 1;
}

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

// All leaves between the packet and a light, in `list`; false where they are too many to list.
inline int list_candidates(Shadows *s, int number, LeafList *list)
{
    *list = make_list(s->lists + number * (ulong)CANDIDATE_WORDS, CANDIDATES);
    if (s->listed[number] == NOT_ASKED) {
        if (!s->bounded) bound_packet(s);
        if (s->seen_box.lo[2] <= s->seen_box.hi[2]) {
            const Shaft shaft = shadow_shaft(shadow_light(s->scene, number), &s->seen_box);
            const Volume volume = {0, &shaft, 0};
            Stack stack;
            start_walk(&stack);
            gather_leaves(s->tree, &volume, FAR, &stack, list);
            s->listed[number] = stack.size ? TOO_MANY : list->count;
        } else s->listed[number] = 0;
    }
    list->count = max(s->listed[number], 0);
    return s->listed[number] >= 0;
}

// What is to be done with the leaves near a set of shadow rays, a few at a time.
typedef struct {
    LeafList candidates;
    int listed;   // whether they are all there is
    int done;
    Shaft shaft;
    Stack stack;
} NearbyLeaves;

inline void start_nearby(Shadows *s, int number, const Box *box, NearbyLeaves *n)
{
    n->listed = list_candidates(s, number, &n->candidates);
    n->done = 0;
    n->shaft = shadow_shaft(shadow_light(s->scene, number), box);
    if (!n->listed) start_walk(&n->stack);
}

// Fill s->nearby with the next leaves; false once none is left.
inline int next_nearby(Shadows *s, NearbyLeaves *n)
{
    LeafList *to = &s->nearby;
    to->count = 0;
    if (n->done) return 0;
    if (!n->listed) {
        const Volume volume = {0, &n->shaft, 0};
        gather_leaves(s->tree, &volume, FAR, &n->stack, to);
        n->done = !n->stack.size;
        return 1;
    }
    const LeafList *from = &n->candidates;
    for (int base = 0; base < from->count; base += LANES) {
        const vi meets = shaft_meets(&n->shaft, from->boxes + base, from->pitch);
        for (uint bits = row_bits(meets) & listed_bits(from, base); bits; bits &= bits - 1) {
            const int at = base + lowest(bits);
            append_leaf(to, from->boxes + at, from->pitch, from->leaf[at]);
        }
    }
    n->done = 1;
    return 1;
}

#endif
