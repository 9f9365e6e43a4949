// Shadows: which rays of a block see each light that casts them.
#ifndef LFCORE_SHADOWS_CL
#define LFCORE_SHADOWS_CL
#include "region_shadows.cl"
#include "block_shadows.cl"

#define LIT_WORDS(lights) ((lights) * BLOCK)
#define SHADOW_WORDS(lights)                                                                     \
    (5 * BLOCK_RAYS + LIST_WORDS(CANDIDATES) + POOL_WORDS + PLANE_WORDS + (lights) +             \
     (lights) * CANDIDATE_WORDS)

// Divide a worker's memory.
inline void start_shadows(const Tree *tree, const Scene *scene, global uint *memory,
                          OccluderCache *cache,
                          Shadows *s)
{
    const int lights = scene->numbers->shadow_lights;
    s->tree = tree;
    s->scene = scene;
    s->open = (global int *)memory;
    s->seen = (global float *)memory + 2 * BLOCK_RAYS;
    memory += 5 * BLOCK_RAYS;
    s->nearby = make_list(memory, CANDIDATES);
    memory += LIST_WORDS(CANDIDATES);
    cache->pool = (global float *)memory;
    memory += POOL_WORDS;
    s->lists = memory;
    memory += lights * CANDIDATE_WORDS;
    s->element_planes = (global PlaneEquations *)memory;
    s->listed = (global int *)memory + PLANE_WORDS;
    s->cache = cache;
}

// To be called once a packet's visibility is known.
inline void enter_packet(const Packet *packet, const Visibility *visibility, Shadows *s)
{
    s->packet = packet;
    s->visibility = visibility;
    s->bounded = 0;
    s->cache->element = -1;
    for (int k = 0; k < s->scene->numbers->shadow_lights; ++k) s->listed[k] = NOT_ASKED;
}

// Find which of a block's rays see each light.
inline void find_lit(Shadows *s, const Block *b)
{
    const int few = few_regions(b);
    if (few) enter_element(s->packet, b->number, s->cache);
    for (int k = 0; k < s->scene->numbers->shadow_lights; ++k) {
        global int *lit = b->lit + k * BLOCK;
        if (!few || !light_regions(s, b, k, lit)) light_block(s, b, k, lit);
    }
}

#endif
