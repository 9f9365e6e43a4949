// Three quantities, such as colours, of the rays of a block: (3, BLOCK_RAYS).
#pragma once
#include "lanes.cl"

#define COLOURS (3 * BLOCK_RAYS)

// Load and store the row of LANES rays that begins at ray `at`.
inline Vec load3(global const float *from, int at)
{
    from += at;
    return (Vec){VLOAD(from), VLOAD(from + BLOCK_RAYS), VLOAD(from + 2 * BLOCK_RAYS)};
}
inline void store3(Vec a, global float *to, int at)
{
    VSTORE(a.x, to + at);
    VSTORE(a.y, to + BLOCK_RAYS + at);
    VSTORE(a.z, to + 2 * BLOCK_RAYS + at);
}
