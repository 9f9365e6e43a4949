// Sets of shadow rays: from hit points in a box to a light.
#pragma once
#include "shadow_origins.cl"
#include "walk.cl"

// The scene and a worker's memory for shadows.
typedef struct {
    const Tree *tree;
    const Scene *scene;
    global int *active;                     // scratch: (2, BLOCK_RAYS)
    global float *projected;                  // scratch: (2, 3, BLOCK_RAYS)
    global const float *origins;            // of the shadow rays: (3, BLOCK_RAYS)
} Shadows;

inline global const LightRecord *shadow_light(const Scene *s, int number)
{
    return s->lights + s->numbers->unshadowed_lights + number;
}

// Mask of the rays, in the row from ray `at` on, whose hit point faces the light and is on the side
// to which the light emits.
inline vi facing_row(global const Hits *s, global const LightRecord *light, int at)
{
    const vi hit = GE(VLOAD(s->key + at), (vi)(0));
    Vec towards = spread3(vload3(0, light->vector));
    if (light->is_point) towards = minus3(towards, load3(s->point, at));
    const vi facing = hit & GT(dot3(load3(s->value[NORMAL], at), towards), (vf)(0.0f));
    const float3 forward = vload3(0, light->normal);
    if (!any(forward != 0.0f)) return facing;
    return facing & LT(dot3(spread3(forward), towards), (vf)(0.0f));
}

// Mask of ids of a light's `triangles`, [first, end), which never shadow it.
inline vi are_of_light(int2 triangles, global const int *ids)
{
    return GE(VLOAD(ids), (vi)(triangles.x)) & LT(VLOAD(ids), (vi)(triangles.y));
}

// Mask of ids of triangles that let light pass: they tint it (tints.cl) and do not occlude it.
inline vi are_clear(const Scene *s, global const int *ids)
{
    private int clear[LANES];
    if (!CLEAR) return 0;
    for (int k = 0; k < LANES; ++k)
        clear[k] = -(ids[k] >= 0 && s->materials[s->material_ids[ids[k]]].clear);
    return VLOAD(clear);
}

inline void clear_lit(global int *lit)
{
    for (int row = 0; row < BLOCK; row += LANES) VSTORE((vi)(0), lit + row);
}

typedef struct {
    int is_point;
    float3 apex;                 // the light, or the centre of the hit points' box
    float3 towards;              // direction to a directional light
    float3 centre, half_extent;  // box of the hit points relative to the apex
    float3 size;                 // bounds of all magnitudes, for the margin
    int2 light_triangles;        // first, end: they never shadow the light
    Sweep shaft;                 // around all rays
    float end;                   // the time at which the shaft reaches the light
} ShadowRays;

inline ShadowRays make_shadow_rays(global const LightRecord *light, const Box *box)
{
    const float3 low = vload3(0, box->lo), high = vload3(0, box->hi);
    ShadowRays r;
    r.is_point = light->is_point;
    r.towards = vload3(0, light->vector);
    r.apex = r.is_point ? r.towards : 0.5f * (low + high);
    r.light_triangles = vload2(0, light->triangles);
    r.centre = 0.5f * (low + high) - r.apex;
    r.half_extent = 0.5f * (high - low);
    r.size = max(fabs(low), fabs(high)) + fabs(r.centre) + r.half_extent;
    r.shaft = make_shaft(r.towards, r.is_point, box);
    r.end = r.is_point ? 1.0f : FAR;
    return r;
}

// The next leaf that may occlude a ray; -1 at the end.
inline int next_occluding(const Tree *tree, const ShadowRays *r, Stack *stack)
{
    const Volume volume = {.sweep = &r->shaft};
    return next_leaf(tree, &volume, r->end, stack);
}
