// The kernel: one packet after the other, from rays to a sink.
//
// A program has one SINK: HITS, triangles and depths; IMAGE, radiance and, if asked for, depths;
// FRAMES, sensor planes (PLANES: 1 of macropixels, 2 of views) and encoder-ready frames (BITS, 0
// for none); GIVEN, the hits of rays that are no bundle.
#include "shade.cl"
#include "shadows.cl"
#include "arrays.cl"
#include "frames.cl"
#include "packet_sums.cl"

// The sink FRAMES: a packet's colours by cells, 16 x 16 inner rays of one element, and their use.
typedef struct {
    global float *colours;     // (cells, 3, BLOCK_RAYS), then a block of several elements
    global ColourRow *prefix;  // (PACKET_COLUMNS + 1,)
    Frames frames;
    SensorPlanes planes;
    Strip strip;
} Cells;

// Clamp a block's colours to what is stored.
inline void clamp_colours(global float *colours)
{
    for (int at = 0; at < COLOURS; at += LANES)
        VSTORE(clamp(VLOAD(colours + at), (vf)(0.0f), (vf)(BRIGHTEST)), colours + at);
}

// Add the cells of a packet to sensor planes, then write them to frames, which overwrites them.
inline void finish_packet(const Packet *packet, Cells *c)
{
    const int2 grid = (int2)(packet->rays->columns, packet->rays->rows);
    const int side = packet->rays->group_side;
    global const Placement *first = c->frames.placements + first_element(packet);
    c->strip.u = first->column / side * side;
    const int v = first->row / side * side;
    if (PLANES == 1) add_to_strip(&c->planes, packet, v, c->colours, c->prefix, &c->strip);
    for (int cell = 0; cell < packet->rays->cells; ++cell) {
        const int element = cell_element(packet, cell);
        if (element < 0) continue;
        const int2 where = cell_position(packet, cell), inside = min(grid - where, BLOCK);
        global const Placement *placed = c->frames.placements + element;
        global float *colours = c->colours + cell * COLOURS;
        if (PLANES == 2) add_view(&c->planes, (int2)(placed->column, placed->row), where, colours);
        if (!BITS) continue;
        write_frames(&c->frames, element, where, inside, colours);
    }
}

// A worker's own memory; a Block's `lit` comes after it.
typedef struct {
    float cells[(MOST_BLOCKS + 1) * COLOURS];
    ColourRow prefix[PACKET_COLUMNS + 1];
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
    b->number = number;
    b->bundle = block_bundle(packet, number);
    find_regions(p->visibility.block + number, block_inside(packet, number), &b->regions);
    sample_block(p->scene, p->pixel_pitch, b);
    if (SHADOWS && b->regions.count) find_lit(&p->shadows, b, p->memory->shadows.lifted);
    shade_background(p->scene, b, colours);
    private int keys[BLOCK_RAYS];
    for (int left = list_keys(b, keys); left; --left)
        shade_key(p->scene, b, keys[left - 1], colours);
}

typedef struct { Arrays arrays; Cells cells; } Sink;

inline void take_block(const Packet *packet, int block, Pipeline *p, const Sink *sink)
{
    // A block of several elements is coloured behind the cells, then copied to them.
    const int cell = SINK != FRAMES ? 0 : OUTER > 1 ? packet->rays->cells : block;
    global float *colours = sink->cells.colours + cell * COLOURS;
    if (SINK != HITS) colour_block(packet, block, p, colours);
    if (SINK != FRAMES)
        write_arrays(packet, block, p->visibility.block + block, colours, &sink->arrays);
    else if (OUTER > 1) spread_colours(packet, block, colours, sink->cells.colours);
    else clamp_colours(colours);
}

// `centre_rays` and `members`: see Rays.  `next_strip` counts from 0.  For each worker `sums`:
// (planes, height, width), `windows`: (planes,) that are empty, `strips`: (planes, ring) of 0.
KERNEL void trace_packets(PARAMETERS)
{
    const Tree tree = {boxes, children, leaves, leaf_ids, {cut_out_of, cut_outs, alpha}};
    const Scene scene = {corners, attributes, material_ids, materials, lights, levels, texels,
                         grids, light, sky, &scene_numbers};
    const Rays rays = make_rays(centre_rays, members, &ray_numbers);
    const ulong worker = get_global_id(0), area = (ulong)plane_numbers.width * plane_numbers.height;
    const ulong strip_rows = (ulong)plane_numbers.ring * plane_numbers.planes;
    const ulong words = SCRATCH_WORDS(scene_numbers.shadow_lights);
    global Memory *memory = (global Memory *)(scratch + worker * words);
    global ShadowMemory *shadows = &memory->shadows;
    Pipeline pipeline = {
        &scene, ray_numbers.pixel_pitch, memory,
        .visibility = {.memory = &memory->visibility},
        .block = {.regions = {memory->regions}, .equations = memory->equations,
                  .samples = &memory->samples, .lit = (global int *)(memory + 1)},
        .shadows = {&tree, &scene, shadows->active, shadows->seen}};
    Sink sink = {
        {triangle, depth, &image, radiance},
        {memory->cells, memory->prefix, {placements, frames, &frame_numbers},
         {&plane_numbers, plane_records, runs, masks, kinds,
          sums + worker * plane_numbers.planes * area},
         {windows + worker * plane_numbers.planes, strips + worker * strip_rows}}};
    const int height = ray_numbers.strip_height, end = ray_numbers.packets / height;
    for (int strip; (strip = atomic_inc(next_strip)) < end;) {
        for (int step = 0; step < height; ++step) {
            Packet packet = make_packet(&rays, strip, height, step);
            if (SINK == GIVEN) {
                hit_given_rays(&tree, &packet, origins, directions, triangle, depth, weights);
                continue;
            }
            if (SINK == FRAMES && PLANES == 1 && !BITS)
                drop_closed_blocks(&sink.cells.planes, &packet);
            if (!packet.blocks) continue;
            find_visible(&tree, &packet, &pipeline.visibility);
            for (int block = 0; block < rays.blocks; ++block)
                if (has_block(&packet, block)) take_block(&packet, block, &pipeline, &sink);
            if (SINK == FRAMES) finish_packet(&packet, &sink.cells);
        }
        if (SINK == FRAMES && PLANES == 1)
            finish_strip(&sink.cells.planes, &rays, strip % rays.packets_in_x, &sink.cells.strip);
    }
}

kernel void scratch_words(const int lights, global int *words)
{
    *words = SINK == GIVEN ? 0 : SCRATCH_WORDS(lights);
}
