// Shadows: which rays of a block see each light that casts them.
#pragma once
#include "region_shadows.cl"
#include "block_shadows.cl"

// A worker's memory: see Shadows and OccluderCache.
typedef struct {
    int active[2 * BLOCK_RAYS];
    OccluderRow pool[POOL / LANES];
    PlaneEquations element_planes;
    float lifted[CURVED ? 3 * BLOCK_RAYS : 1];
} ShadowMemory;

inline void start_shadows(const Tree *tree, const Scene *scene, global ShadowMemory *memory,
                          OccluderCache *cache, Shadows *s)
{
    *s = (Shadows){tree, scene, 0, memory->active, 0, cache, &memory->element_planes};
    cache->pool = memory->pool;
}

inline void enter_packet(const Packet *packet, Shadows *s)
{
    s->packet = packet;
    s->cache->element = -1;
}

// Find which of a block's rays see each light.
inline void find_lit(Shadows *s, const Block *b, global float *lifted)
{
    const int curved = CURVED && lift_origins(s->scene, b, lifted);
    const int few = !curved && few_regions(b);
    s->origins = curved ? lifted : b->samples->point;
    if (few) enter_element(s->packet, b->number, s->cache);
    for (int k = 0; k < s->scene->numbers->shadow_lights; ++k) {
        global int *lit = b->lit + k * BLOCK;
        if (!few || !light_regions(s, b, k, lit)) light_block(s, b, shadow_light(s->scene, k), lit);
    }
}
