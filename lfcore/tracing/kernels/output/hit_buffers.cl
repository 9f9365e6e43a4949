// Triangles and depths of a block's hits.
#pragma once
#include "visibility.cl"

// (E, rows, columns) each.
typedef struct {
    global int *triangle;
    global float *depth;
} HitBuffers;

// Write a number of each of a block's rays, those of one element and one row of the inner grid at a
// time.
inline void write_rays(const Packet *p, int block, global const uint *from, global uint *to)
{
    const Rays *rays = p->rays;
    const int2 where = block_position(p, block), inside = block_inside(p, block);
    for (int at = 0; at < BLOCK_RAYS; at += INNER) {
        const int row = at / BLOCK % INNER;
        const int element = block_element(p, block, at % BLOCK / INNER, at / BLOCK / INNER);
        if (element < 0 || row >= inside.y) continue;
        const ulong line = (ulong)element * rays->rows + where.y + row;
        global uint *out = to + line * rays->columns + where.x;
        for (int k = 0; k < inside.x; k += 4)
            if (k + 4 <= inside.x) vstore4(vload4(0, from + at + k), 0, out + k);
            else
                for (int rest = k; rest < inside.x; ++rest) out[rest] = from[at + rest];
    }
}

inline void write_depths(const Packet *p, int block, Coverage *c, global float *depth)
{
    use_buffer(c);
    write_rays(p, block, (global const uint *)c->z, (global uint *)depth);
}

inline void write_hits(const Packet *p, int block, Coverage *c, const HitBuffers *to)
{
    write_depths(p, block, c, to->depth);
    write_rays(p, block, (global const uint *)c->ids, (global uint *)to->triangle);
}
