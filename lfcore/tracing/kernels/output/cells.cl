// Cells: the colours of a packet, 16 x 16 inner rays of one element at a time, and what is made of
// them: sensor planes and frames.
#pragma once
#include "frames.cl"
#include "packet_sums.cl"

#define COLOURS (3 * BLOCK_RAYS)  // of one cell
typedef struct {
    global float *colours;     // (cells, 3, BLOCK_RAYS), and of one block of several elements
    global ColourRow *prefix;  // (PACKET_COLUMNS + 1,)
    Frames frames;
    SensorPlanes planes;
    Strip strip;
    int u;                     // first column of the strip's pixels
} Cells;

// Where the colours of a block of a packet are made.
inline global float *block_colours(const Cells *c, const Packet *packet, int block)
{
    return c->colours + (OUTER > 1 ? packet->rays->cells : block) * COLOURS;
}

// Clamp a block's colours to what is stored; those of several elements are put into their cells.
inline void clamp_colours(const Cells *c, const Packet *packet, int block, global float *colours)
{
    if (OUTER == 1) {
        for (int at = 0; at < COLOURS; at += LANES)
            VSTORE(clamp(VLOAD(colours + at), (vf)(0.0f), (vf)(BRIGHTEST)), colours + at);
        return;
    }
    const int2 first = packet->rays->block[block].at;
    const int side = packet->rays->packet_side / BLOCK;
    const int within = first.y / BLOCK * side + first.x / BLOCK;
    const int corner = first.y % BLOCK * BLOCK + first.x % BLOCK;
    for (int at = 0; at < BLOCK_RAYS; at += 4) {
        const int element = at / BLOCK / INNER * OUTER + at % BLOCK / INNER;
        const int ray = corner + at / BLOCK % INNER * BLOCK + at % INNER;
        global float *to = c->colours + (element * side * side + within) * COLOURS + ray;
        for (int channel = 0; channel < 3; ++channel) {
            const float4 colour = vload4(0, colours + channel * BLOCK_RAYS + at);
            vstore4(clamp(colour, 0.0f, BRIGHTEST), 0, to + channel * BLOCK_RAYS);
        }
    }
}

// Write the cells of a packet: planes of views, and frames, in which the cells end.
inline void write_cells(const Cells *c, const Packet *packet)
{
    const int2 grid = (int2)(packet->rays->columns, packet->rays->rows);
    for (int cell = 0; cell < packet->rays->cells; ++cell) {
        const int element = cell_element(packet, cell);
        if (element < 0) continue;
        const int2 where = cell_position(packet, cell);
        global const Slot *slot = c->frames.slots + element;
        global float *colours = c->colours + cell * COLOURS;
        if (PLANES == 2) add_view(&c->planes, (int2)(slot->column, slot->row), where, colours);
        if (BITS) write_frames(&c->frames, element, where, min(grid - where, BLOCK), colours);
    }
}

// Hand on the cells of a packet that was coloured, and its strip after the last packet.
inline void finish_packet(const Packet *packet, const PacketQueue *queue, Cells *c)
{
    const Rays *rays = packet->rays;
    if (packet->blocks) {
        global const Slot *slot = c->frames.slots + first_element(packet);
        c->u = slot->column / rays->group * rays->group;
        const int v = slot->row / rays->group * rays->group;
        if (PLANES == 1) add_to_strip(&c->planes, packet, v, c->colours, c->prefix, &c->strip);
        write_cells(c, packet);
    }
    if (PLANES == 1 && queue->step == queue->height - 1)
        finish_strip(&c->planes, rays, c->u, queue->strip % rays->packets_in_x, &c->strip);
}
