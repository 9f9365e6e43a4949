// The way of a packet: visibility, then for each block regions, samples, shadows and colours.
#ifndef LFCORE_PIPELINE_CL
#define LFCORE_PIPELINE_CL
#include "arguments.cl"
#include "regions.cl"
#include "shade.cl"
#include "shadows.cl"

// A worker's own memory, in words of four bytes.
#define PIPELINE_WORDS(lights)                                                        \
    (VISIBILITY_WORDS + BLOCK_RAYS * (REGION_WORDS + PLANE_WORDS) + SAMPLE_WORDS +    \
     SHADOWS * (LIT_WORDS(lights) + SHADOW_WORDS))

typedef struct {
    const Tree *tree;
    const Scene *scene;
    float pixel;  // tangent between neighbouring pixels
    global uint *memory;
    Visibility visibility;
    Block block;
    OccluderCache cache;
    Shadows shadows;
} Pipeline;

// Divide `memory`, of PIPELINE_WORDS.
inline void start_pipeline(const Tree *tree, const Scene *scene, float pixel, global uint *memory,
                           Pipeline *p)
{
    p->tree = tree;
    p->scene = scene;
    p->pixel = pixel;
    p->memory = memory;
    memory += VISIBILITY_WORDS;
    p->block.regions.of = (global Region *)memory;
    memory += BLOCK_RAYS * REGION_WORDS;
    p->block.planes = (global PlaneEquations *)memory;
    memory += BLOCK_RAYS * PLANE_WORDS;
    p->block.samples = make_samples(memory);
    memory += SAMPLE_WORDS;
    p->block.lit = (global int *)memory;
    memory += LIT_WORDS(scene->numbers->shadow_lights);
    if (SHADOWS) start_shadows(tree, scene, memory, &p->cache, &p->shadows);
}

// Find what a whole packet sees.
inline void see_packet(const Packet *packet, Pipeline *p)
{
    start_visibility(p->memory, &p->visibility);
    find_visible(p->tree, packet, &p->visibility);
    if (SHADOWS) enter_packet(packet, &p->shadows);
}

// Linear colours, not clamped, of one block of a packet that was seen: (3, BLOCK_RAYS).
inline void colour_block(const Packet *packet, int number, Pipeline *p, global float *colours)
{
    Block *b = &p->block;
    b->number = number;
    b->rays = block_bundle(packet, number);
    find_regions(p->visibility.block + number, block_inside(packet, number), &b->regions);
    if (!b->regions.count) {
        shade_background(p->scene, colours);
        return;
    }
    sample_block(p->scene, p->pixel, b);
    if (SHADOWS) find_lit(&p->shadows, b);
    shade_block(p->scene, b, colours);
}

#endif
