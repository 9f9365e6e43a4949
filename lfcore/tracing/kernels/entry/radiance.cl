// Linear radiance of bundles as floats and, if asked for, the depth of each ray's hit.
//
// Element e is tile (e / across, e % across) of one image; with one tile across, elements follow
// each other.
#include "pipeline.cl"
#include "hit_buffers.cl"
#include "radiance_image.cl"

typedef struct {
    float colours[3 * BLOCK_RAYS];
    PipelineMemory pipeline;
} Memory;

// `radiance`: (E / across * rows, across * columns, 3); `depth`, if DEPTHS: (E, rows, columns).
KERNEL void trace_radiance(TRACE_RADIANCE_PARAMETERS)
{
    const Tree tree = MAKE_TREE;
    const Scene scene = MAKE_SCENE;
    const Rays rays = MAKE_RAYS;
    const ulong pitch = 3 * (ulong)image.across * rays.columns;
    const ulong words = SCRATCH_WORDS(scene_numbers.shadow_lights);
    global Memory *memory = (global Memory *)(scratch + get_global_id(0) * words);
    Pipeline pipeline;
    start_pipeline(&tree, &scene, ray_numbers.pixel_tangent, &memory->pipeline, &pipeline);
    PacketQueue queue = make_queue(next, ray_numbers.packets, 1);
    for (Packet packet; next_packet(&rays, &queue, &packet);) {
        see_packet(&packet, &pipeline);
        for (int block = 0; block < rays.blocks; ++block) {
            if (!has_block(&packet, block)) continue;
            colour_block(&packet, block, &pipeline, memory->colours);
            const int2 where = block_position(&packet, block);
            const int element = block_element(&packet, block, 0, 0);
            const ulong row = (ulong)(element / image.across) * rays.rows + where.y;
            const ulong column = (ulong)(element % image.across) * rays.columns + where.x;
            write_radiance(memory->colours, block_inside(&packet, block), image.mode,
                           radiance + row * pitch + 3 * column, pitch);
        }
        for (int block = 0; (image.mode & DEPTHS) && block < rays.blocks; ++block)
            if (has_block(&packet, block))
                write_depths(&packet, block, pipeline.visibility.block + block, depth);
    }
}

kernel void scratch_words(const int lights, global int *words) { *words = SCRATCH_WORDS(lights); }
