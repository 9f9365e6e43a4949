// The whole of Algorithms 1 and 3 for one chunk of a tile: see, cast shadows, shade, form sensor
// planes (PLANES: 1 of macropixels, 2 of views) and write encoder-ready frames (BITS, 0 for none).
#include "pipeline.cl"
#include "packet_sums.cl"
#include "frames.cl"

#define COLOURS (3 * BLOCK_RAYS)  // of one cell of a packet
typedef struct {
    float cells[(MOST_BLOCKS + 1) * COLOURS];
    uint prefix[PREFIX_WORDS];
    PipelineMemory pipeline;
} Memory;

// Clamp the colours of a block of several elements to what is stored, and put them where its cells
// are; `first` is its column and row in the packet.
inline void sort_into_cells(const Rays *rays, int2 first, global const float *from,
                            global float *cells)
{
    const int side = rays->packet_side / BLOCK, within = first.y / BLOCK * side + first.x / BLOCK;
    const int corner = first.y % BLOCK * BLOCK + first.x % BLOCK;
    for (int at = 0; at < BLOCK_RAYS; at += 4) {
        const int element = at / BLOCK / INNER * OUTER + at % BLOCK / INNER;
        const int ray = corner + at / BLOCK % INNER * BLOCK + at % INNER;
        global float *to = cells + (element * side * side + within) * COLOURS + ray;
        for (int channel = 0; channel < 3; ++channel) {
            const float4 c = vload4(0, from + channel * BLOCK_RAYS + at);
            vstore4(clamp(c, 0.0f, 1.0f), 0, to + channel * BLOCK_RAYS);
        }
    }
}

// Linear colours of every cell of a packet within [0, 1]: (cells, 3, BLOCK_RAYS).
inline void colour_packet(const Packet *packet, Pipeline *pipeline, global float *cells)
{
    const Rays *rays = packet->rays;
    see_packet(packet, pipeline);
    for (int block = 0; block < rays->blocks; ++block) {
        if (!has_block(packet, block)) continue;
        global float *colours = cells + (OUTER > 1 ? rays->cells : block) * COLOURS;
        colour_block(packet, block, pipeline, colours);
        if (OUTER > 1) {
            sort_into_cells(rays, rays->block[block].at, colours, cells);
            continue;
        }
        for (int at = 0; at < COLOURS; at += LANES)
            VSTORE(clamp(VLOAD(colours + at), (vf)(0.0f), (vf)(1.0f)), colours + at);
    }
}

// What is made of a packet cell by cell: planes of views, and frames, in which the cells end.
inline void write_cells(const Planes *planes, const Frames *out, const Packet *packet,
                        global float *cells)
{
    const int2 grid = (int2)(packet->rays->columns, packet->rays->rows);
    for (int cell = 0; cell < packet->rays->cells; ++cell, cells += COLOURS) {
        const int element = cell_element(packet, cell);
        if (element < 0) continue;
        const int2 where = cell_position(packet, cell);
        global const Slot *slot = out->slots + element;
        if (PLANES == 2) add_view(planes, (int2)(slot->column, slot->row), where, cells);
        if (BITS) write_frames(out, element, where, min(grid - where, BLOCK), cells);
    }
}

// For each worker `sums`: (planes, height, width), `windows`: (planes,) that are empty, `strips`:
// (planes, ring, PREFIX_PITCH) of 0.
KERNEL void trace_slab(TRACE_SLAB_PARAMETERS)
{
    const Tree tree = MAKE_TREE;
    const Scene scene = MAKE_SCENE;
    const Rays rays = MAKE_RAYS;
    const Frames out = {slots, frames, &frame_numbers};
    const ulong worker = get_global_id(0), area = (ulong)plane_numbers.width * plane_numbers.height;
    const Planes planes = {&plane_numbers, plane_records, runs, masks, kinds,
                           sums + worker * plane_numbers.planes * area};
    const ulong strip_words = (ulong)plane_numbers.ring * PREFIX_PITCH * plane_numbers.planes;
    const Strip strip = {windows + worker * plane_numbers.planes, strips + worker * strip_words};
    const ulong words = SCRATCH_WORDS(scene_numbers.shadow_lights);
    global Memory *memory = (global Memory *)(scratch + worker * words);
    global float *cells = memory->cells;
    Pipeline pipeline;
    start_pipeline(&tree, &scene, ray_numbers.pixel_tangent, &memory->pipeline, &pipeline);
    PacketQueue queue = make_queue(next, ray_numbers.packets, plane_numbers.strip_height);
    int u = 0;  // first column of the strip's pixels
    for (Packet packet; next_packet(&rays, &queue, &packet);) {
        const int first = first_element(&packet);
        if (first >= 0) {
            if (PLANES == 1 && !BITS) drop_closed_blocks(&planes, &packet);
            colour_packet(&packet, &pipeline, cells);
            u = slots[first].column / rays.group * rays.group;
            const int v = slots[first].row / rays.group * rays.group;
            if (PLANES == 1) add_to_strip(&planes, &packet, v, cells, memory->prefix, &strip);
            write_cells(&planes, &out, &packet, cells);
        }
        if (PLANES == 1 && queue.step == queue.height - 1)
            finish_strip(&planes, &rays, u, queue.strip % rays.packets_in_x, &strip);
    }
}

kernel void scratch_words(const int lights, global int *words) { *words = SCRATCH_WORDS(lights); }
