// Visibility alone: the closest triangle and its depth for every ray of a job.
#include "hit_buffers.cl"

// `depth` and `triangle`: (E, rows, columns).
KERNEL void slab_hits(SLAB_HITS_PARAMETERS)
{
    const Tree tree = MAKE_TREE;
    const Rays rays = MAKE_RAYS;
    global VisibilityMemory *memory = (global VisibilityMemory *)scratch + get_global_id(0);
    Visibility visibility;
    PacketQueue queue = make_queue(next, ray_numbers.packets, 1);
    for (Packet packet; next_packet(&rays, &queue, &packet);) {
        start_visibility(&rays, memory, &visibility);
        find_visible(&tree, &packet, &visibility);
        for (int block = 0; block < rays.blocks; ++block) {
            if (!has_block(&packet, block)) continue;
            write_hits(&packet, block, visibility.block + block, depth, triangle);
        }
    }
}

kernel void scratch_words(const int lights, global int *words)
{
    *words = sizeof(VisibilityMemory) / 4;
}
