// The kernel: traces one packet after the other into a sink.
//
// A program has one SINK: HITS writes triangles and depths; IMAGE radiance and optionally depths;
// GIVEN the hits of single rays.
#include "shade.cl"
#include "shadows.cl"
#include "arrays.cl"

// A worker's memory; its Block's `lit` follows.
typedef struct {
    float colours[COLOURS];
    VisibilityMemory visibility;
    Region regions[BLOCK_RAYS];
    PlaneEquations equations[BLOCK_RAYS];
    Samples samples;
    ShadowMemory shadows;
} Memory;

// Words of a worker's memory, with the masks of its shadow rays.
#define SCRATCH_WORDS(lights) (sizeof(Memory) / 4 + (ulong)(lights) * BLOCK)

typedef struct {
    const Scene *scene;
    float pixel_pitch;  // tangent between neighbouring pixels
    global Memory *memory;
    Visibility visibility;
    Block block;
    Shadows shadows;
} Pipeline;

// Linear colours, not clamped, of one block after find_visible: (3, BLOCK_RAYS).
inline void colour_block(const Packet *packet, int number, Pipeline *p, global float *colours)
{
    Block *b = &p->block;
    b->bundle = block_bundle(packet, number);
    find_regions(p->visibility.block + number, block_inside(packet, number), &b->regions);
    sample_block(p->scene, p->pixel_pitch, b);
    if (SHADOWS && b->regions.count) find_lit(&p->shadows, b, p->memory->shadows.origins);
    shade_background(p->scene, b, colours);
    private int keys[BLOCK_RAYS];
    for (int left = list_keys(b, keys); left; --left)
        shade_key(p->scene, b, keys[left - 1], colours);
}

inline void take_block(const Packet *packet, int block, Pipeline *p, const Arrays *out)
{
    global float *colours = p->memory->colours;
    if (SINK == IMAGE) colour_block(packet, block, p, colours);
    write_arrays(packet, block, p->visibility.block + block, colours, out);
}

// `centre_rays` and `members`: see Rays.  `next_packet` counts from 0.
KERNEL void trace_packets(trace_packets_PARAMETERS)
{
    const Tree tree = {.boxes = boxes, .children = children, .leaves = leaves,
                       .leaf_ids = leaf_ids, .alpha_tests = {alpha_test_of, alpha_tests, alpha}};
    const Scene scene = {.corners = corners, .attributes = attributes,
                         .material_ids = material_ids, .materials = materials, .lights = lights,
                         .levels = levels, .texels = texels, .grids = grids, .light = light,
                         .sky = sky, .numbers = &scene_numbers};
    const Rays rays = make_rays(centre_rays, members, &ray_numbers);
    const ulong worker = get_global_id(0);
    const ulong words = SCRATCH_WORDS(scene_numbers.shadow_lights);
    global Memory *memory = (global Memory *)(scratch + worker * words);
    global ShadowMemory *shadows = &memory->shadows;
    Pipeline pipeline = {
        &scene, ray_numbers.pixel_pitch, memory,
        .visibility = {.memory = &memory->visibility},
        .block = {.regions = {memory->regions}, .equations = memory->equations,
                  .samples = &memory->samples, .lit = (global int *)(memory + 1)},
        .shadows = {&tree, &scene, shadows->active, shadows->projected}};
    const Arrays arrays = {triangle, depth, &image, radiance};
    for (int number; (number = atomic_inc(next_packet)) < ray_numbers.packets;) {
        const Packet packet = make_packet(&rays, number);
        if (SINK == GIVEN) {
            hit_given_rays(&tree, &packet, origins, directions, triangle, depth, weights);
            continue;
        }
        if (!packet.blocks) continue;
        find_visible(&tree, &packet, &pipeline.visibility);
        for (int block = 0; block < rays.blocks; ++block)
            if (has_block(&packet, block)) take_block(&packet, block, &pipeline, &arrays);
    }
}

kernel void scratch_words(const int lights, global int *words)
{
    *words = SINK == GIVEN ? 0 : SCRATCH_WORDS(lights);
}
