// What a block's rays met, written as triangles and depths.
#ifndef LFCORE_HITS_CL
#define LFCORE_HITS_CL
#include "visibility.cl"

// Write what a block saw, its rays of one element and one row of the inner grid at a time.
inline void write_hits(const Packet *p, int block, const Coverage *c, global float *depth,
                       global int *triangle)
{
    const Rays *rays = p->rays;
    const int2 where = block_position(p, block), inside = block_inside(p, block);
    for (int at = 0; at < BLOCK_RAYS; at += INNER) {
        const int row = at / BLOCK % INNER;
        const int element = block_element(p, block, at % BLOCK / INNER, at / BLOCK / INNER);
        if (element < 0 || row >= inside.y) continue;
        const ulong line = (ulong)element * rays->rows + where.y + row;
        global float *z = depth + line * rays->columns + where.x;
        global int *ids = triangle + line * rays->columns + where.x;
        for (int k = 0; k < inside.x; k += 4)
            if (k + 4 <= inside.x) {
                vstore4(vload4(0, c->z + at + k), 0, z + k);
                vstore4(vload4(0, c->ids + at + k), 0, ids + k);
            } else
                for (int rest = k; rest < inside.x; ++rest) {
                    z[rest] = c->z[at + rest];
                    ids[rest] = c->ids[at + rest];
                }
    }
}

#endif
