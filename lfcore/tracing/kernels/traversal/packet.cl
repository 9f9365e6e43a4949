// Packets of blocks: the unit of work that one worker takes at a time.
//
// A packet is ELEMENTS neighbouring elements (pixels, lens samples, data cameras) times a square of
// SIDE x SIDE blocks of the inner grid.  Blocks of one element come element after element, row by
// row; where a block spans OUTER x OUTER elements, that is all that the packet has.  What leaves a
// packet does so in cells of 16 x 16 inner rays of one element, element after element.
#ifndef LFCORE_PACKET_CL
#define LFCORE_PACKET_CL
#include "frustum.cl"

#define ELEMENT_BLOCKS (SIDE * SIDE)
#define PACKET_BLOCKS (ELEMENTS / (OUTER * OUTER) * ELEMENT_BLOCKS)
#define PACKET_SIDE (SIDE * INNER)      // inner rays along a side of a packet
#define CELL_SIDE (PACKET_SIDE / BLOCK)  // cells along it
#define ELEMENT_CELLS (CELL_SIDE * CELL_SIDE)
#define PACKET_CELLS (ELEMENTS * ELEMENT_CELLS)

// The rays of a job: the outer elements, and the inner grid that all of them share.
typedef struct {
    global const float4 *elements;  // ox, oy, dx, dy at the middle of the inner grid: of each of E
                                    // elements, or, for blocks of several, of each of B groups
    global const int *groups;       // (B, ELEMENTS) element or -1
    float4 step;                    // sx, sy, tx, ty: per column and row of the inner grid
    float2 outer;                   // a, b: per element of a group
    int columns, rows;              // size of the inner grid
    // Packets along a row of one group's inner grid, and in all of it.
    int across, squares;
} Rays;

// What the host gives of them.
typedef struct {
    float step[4], outer[2];
    int columns, rows;
    int packets;          // in all
    float pixel_tangent;  // between neighbouring pixels
} RayArguments;

inline Rays make_rays(global const float4 *elements, global const int *groups,
                      const RayArguments *a)
{
    const int across = (a->columns + PACKET_SIDE - 1) / PACKET_SIDE;
    const int down = (a->rows + PACKET_SIDE - 1) / PACKET_SIDE;
    return (Rays){elements, groups, vload4(0, a->step), vload2(0, a->outer),
                  a->columns, a->rows, across, across * down};
}

// What every kernel of a job is given: its rays, the number (1,) of the next packet to take, and
// memory for each worker.
#define RAY_PARAMETERS                      \
    global const float4 *restrict elements, \
    global const int *restrict groups,      \
    const RayArguments ray_numbers,         \
    global int *restrict next,              \
    global uint *restrict scratch
#define MAKE_RAYS make_rays(elements, groups, &ray_numbers)

typedef struct {
    const Rays *rays;
    int group;                       // which of the groups of elements
    global const int *element;       // (ELEMENTS,)
    int column, row;                 // first column and row of the inner grid
    uint blocks;                     // a bit for each block that has rays that are wanted
} Packet;

// Column and row of square `number` of an element's side x side squares.
inline int2 square_of(int number, int side)
{
    return (int2)(number % side, number % (side * side) / side);
}

// First column and row of a block in the inner grid.
inline int2 block_position(const Packet *p, int block)
{
    return (int2)(p->column, p->row) + square_of(block, SIDE) * INNER;
}

// Columns and rows of a block that lie in the inner grid.
inline int2 block_inside(const Packet *p, int block)
{
    const int2 grid = (int2)(p->rays->columns, p->rays->rows);
    return clamp(grid - block_position(p, block), 0, INNER);
}

// First column and row of a cell in the inner grid.
inline int2 cell_position(const Packet *p, int cell)
{
    return (int2)(p->column, p->row) + square_of(cell, CELL_SIDE) * BLOCK;
}

inline int has_block(const Packet *p, int block) { return p->blocks >> block & 1; }

// The element of a block's rays at place (u, v) of its OUTER x OUTER, or -1.
inline int block_element(const Packet *p, int block, int u, int v)
{
    return p->element[OUTER > 1 ? v * OUTER + u : block / ELEMENT_BLOCKS];
}

// The element of a cell, or -1 if it has no rays or none that are wanted.
inline int cell_element(const Packet *p, int cell)
{
    const int2 square = square_of(cell, CELL_SIDE);
    const int first = (square.y * SIDE + square.x) * OUTER;
    return has_block(p, OUTER > 1 ? first : cell) ? p->element[cell / ELEMENT_CELLS] : -1;
}

// The middle ray of what a block is counted from.
inline float4 middle_of(const Packet *p, int block)
{
    return p->rays->elements[OUTER > 1 ? p->group : p->element[block / ELEMENT_BLOCKS]];
}

// The rays about a place of the inner grid, `extent` columns and rows beyond `at`.
inline Bundle bundle_at(const Rays *rays, float4 middle, int2 at, float extent)
{
    const float2 grid = (float2)(rays->columns - 1, rays->rows - 1);
    const float2 c = convert_float2(at) + extent - 0.5f * grid;
    const float4 s = rays->step, first = fma(c.xyxy, s, middle);
    return (Bundle){first.x, first.y, first.z, first.w,
                    s.x, s.y, s.z, s.w, rays->outer.x, rays->outer.y};
}

inline Bundle block_bundle(const Packet *p, int block)
{
    return bundle_at(p->rays, middle_of(p, block), block_position(p, block), HALF);
}

// One element's part of the packet, as if it were one block, and where a block lies from its
// centre.
#define ELEMENT_HALF (0.5f * (SIDE - 1) * INNER + HALF)
inline Bundle element_bundle(const Packet *p, int block)
{
    return bundle_at(p->rays, middle_of(p, block), (int2)(p->column, p->row), ELEMENT_HALF);
}
inline float2 block_offset(int block)
{
    return (convert_float2(square_of(block, SIDE)) - 0.5f * (SIDE - 1)) * INNER;
}

inline Packet make_packet(const Rays *rays, int number)
{
    const int square = number % rays->squares;
    Packet p;
    p.rays = rays;
    p.group = number / rays->squares;
    p.element = rays->groups + p.group * ELEMENTS;
    p.column = (square % rays->across) * PACKET_SIDE;
    p.row = (square / rays->across) * PACKET_SIDE;
    p.blocks = 0;
    for (int block = 0; block < PACKET_BLOCKS; ++block) {
        const int2 at = block_position(&p, block);
        const int there = OUTER > 1 || block_element(&p, block, 0, 0) >= 0;
        if (there && at.x < rays->columns && at.y < rays->rows) p.blocks |= 1u << block;
    }
    return p;
}

// The first element of a packet; negative if it has none.
inline int first_element(const Packet *p)
{
    for (int k = 0; k < ELEMENTS; ++k)
        if (p->element[k] >= 0) return p->element[k];
    return -1;
}

// What holds every ray of the packet.
inline Frustum packet_frustum(const Packet *p)
{
    float4 lo = FAR, hi = -FAR;
    for (int block = 0; block < PACKET_BLOCKS; block += ELEMENT_BLOCKS) {
        if (OUTER == 1 && block_element(p, block, 0, 0) < 0) continue;
        lo = min(lo, middle_of(p, block));
        hi = max(hi, middle_of(p, block));
    }
    const int2 at = (int2)(p->column, p->row);
    const Bundle first = bundle_at(p->rays, lo, at, ELEMENT_HALF);
    const Bundle last = bundle_at(p->rays, hi, at, ELEMENT_HALF);
    return make_frustum(&first, &last, ELEMENT_HALF);
}

#endif
