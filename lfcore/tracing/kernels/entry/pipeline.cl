// The way of a packet: visibility, then for each block regions, samples, shadows and colours.
#pragma once
#include "regions.cl"
#include "shade.cl"
#include "shadows.cl"

// A worker's own memory; a Block's `lit` comes after it.
typedef struct {
    VisibilityMemory visibility;
    Region regions[BLOCK_RAYS];
    PlaneEquations planes[BLOCK_RAYS];
    Samples samples;
    ShadowMemory shadows;
} PipelineMemory;

typedef struct {
    const Tree *tree;
    const Scene *scene;
    float pixel;  // tangent between neighbouring pixels
    global PipelineMemory *memory;
    Visibility visibility;
    Block block;
    OccluderCache cache;
    Shadows shadows;
} Pipeline;

inline void start_pipeline(const Tree *tree, const Scene *scene, float pixel,
                           global PipelineMemory *memory, Pipeline *p)
{
    p->tree = tree;
    p->scene = scene;
    p->pixel = pixel;
    p->memory = memory;
    p->block.regions.of = memory->regions;
    p->block.planes = memory->planes;
    p->block.samples = &memory->samples;
    p->block.lit = (global int *)(memory + 1);
    if (SHADOWS) start_shadows(tree, scene, &memory->shadows, &p->cache, &p->shadows);
}

// Find what a whole packet sees.
inline void see_packet(const Packet *packet, Pipeline *p)
{
    start_visibility(packet->rays, &p->memory->visibility, &p->visibility);
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
    if (SHADOWS) find_lit(&p->shadows, b, p->memory->shadows.lifted);
    shade_block(p->scene, b, colours);
}
