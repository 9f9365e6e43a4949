// Shadows: which rays of a block see each light that casts them.
#ifndef LFCORE_SHADOWS_CL
#define LFCORE_SHADOWS_CL
#include "region_shadows.cl"
#include "block_shadows.cl"

#define LIT_WORDS(lights) ((lights) * BLOCK)
#define SHADOW_WORDS (5 * BLOCK_RAYS + POOL_WORDS + PLANE_WORDS)

// Divide a worker's memory.
inline void start_shadows(const Tree *tree, const Scene *scene, global uint *memory,
                          OccluderCache *cache,
                          Shadows *s)
{
    s->tree = tree;
    s->scene = scene;
    s->open = (global int *)memory;
    s->seen = (global float *)memory + 2 * BLOCK_RAYS;
    memory += 5 * BLOCK_RAYS;
    cache->pool = (global float *)memory;
    s->element_planes = (global PlaneEquations *)(memory + POOL_WORDS);
    s->cache = cache;
}

inline void enter_packet(const Packet *packet, Shadows *s)
{
    s->packet = packet;
    s->cache->element = -1;
}

// Find which of a block's rays see each light.
inline void find_lit(Shadows *s, const Block *b)
{
    const int few = few_regions(b);
    if (few) enter_element(s->packet, b->number, s->cache);
    for (int k = 0; k < s->scene->numbers->shadow_lights; ++k) {
        global int *lit = b->lit + k * BLOCK;
        if (!few || !light_regions(s, b, k, lit)) light_block(s, b, shadow_light(s->scene, k), lit);
    }
}

#endif
