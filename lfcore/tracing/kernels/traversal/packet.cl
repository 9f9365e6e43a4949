// Packets of blocks: the unit of work that one worker takes at a time.
//
// A packet is a square of neighbouring elements (pixels, lens samples, data cameras) times a square
// of blocks of the inner grid.  Blocks of one element come element after element, row by row; where
// a block spans OUTER x OUTER elements, that is all that the packet has.  What leaves a packet does
// so in cells of 16 x 16 inner rays of one element, element after element.
#ifndef LFCORE_PACKET_CL
#define LFCORE_PACKET_CL
#include "frustum.cl"

#define MOST_BLOCKS 16  // of a packet, and most of its cells

// Where a block or a cell lies: which of the packet's elements it is of, the first of several, and
// its first column and row from the packet's.
typedef struct { int element; int2 at; } Place;

// The rays of a job: the outer elements, and the inner grid that all of them share.
typedef struct {
    global const float4 *elements;  // ox, oy, dx, dy at the middle of the inner grid: of each of E
                                    // elements, or, for blocks of several, of each of B groups
    global const int *groups;       // (B, group, group) element or -1
    float4 step;                    // sx, sy, tx, ty: per column and row of the inner grid
    float2 outer;                   // a, b: per element of a group
    int columns, rows;              // size of the inner grid
    float extent;                   // of a block, as in Bundle, and of one element's part of a
    float element_extent;           // packet
    // Of a packet: elements along a side, blocks and inner rays along a side of one element's part,
    // and how many blocks and cells there are.
    int group, side, packet_side, blocks, cells;
    Place block[MOST_BLOCKS], cell[MOST_BLOCKS];
    // Packets along a row of one group's inner grid, and in all of it.
    int across, squares;
} Rays;

// Places of `side` x `side` squares of inner rays for each of so many elements; how many they are.
inline int make_places(int elements, int side, int size, Place *out)
{
    int count = 0;
    for (int element = 0; element < elements; ++element)
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x)
                out[count++] = (Place){element, (int2)(x, y) * size};
    return count;
}

inline Rays make_rays(global const float4 *elements, global const int *groups,
                      const RayArguments *a)
{
    const int wide = a->side * INNER, all = a->group * a->group;
    Rays r = {elements, groups, vload4(0, a->step), vload2(0, a->outer), a->columns, a->rows,
              a->half_extent, 0.5f * (wide - INNER) + a->half_extent, a->group, a->side, wide};
    r.blocks = make_places(OUTER > 1 ? 1 : all, a->side, INNER, r.block);
    r.cells = make_places(all, wide / BLOCK, BLOCK, r.cell);
    r.across = (a->columns + wide - 1) / wide;
    r.squares = r.across * ((a->rows + wide - 1) / wide);
    return r;
}

// Of a kernel's parameters.
#define MAKE_RAYS make_rays(elements, groups, &ray_numbers)

typedef struct {
    const Rays *rays;
    int group;                       // which of the groups of elements
    global const int *element;       // (group, group)
    int2 at;                         // first column and row of the inner grid
    uint blocks;                     // a bit for each block that has rays that are wanted
} Packet;

// First column and row of a block in the inner grid.
inline int2 block_position(const Packet *p, int block) { return p->at + p->rays->block[block].at; }

// Columns and rows of a block that lie in the inner grid.
inline int2 block_inside(const Packet *p, int block)
{
    const int2 grid = (int2)(p->rays->columns, p->rays->rows);
    return clamp(grid - block_position(p, block), 0, INNER);
}

// First column and row of a cell in the inner grid.
inline int2 cell_position(const Packet *p, int cell) { return p->at + p->rays->cell[cell].at; }

inline int has_block(const Packet *p, int block) { return p->blocks >> block & 1; }

// The element of a block's rays at place (u, v) of its OUTER x OUTER, or -1.
inline int block_element(const Packet *p, int block, int u, int v)
{
    return p->element[OUTER > 1 ? v * OUTER + u : p->rays->block[block].element];
}

// The element of a cell, or -1 if it has no rays or none that are wanted.
inline int cell_element(const Packet *p, int cell)
{
    const Place place = p->rays->cell[cell];
    const int2 square = place.at / INNER;
    const int block = OUTER > 1 ? square.y * p->rays->side + square.x : cell;
    return has_block(p, block) ? p->element[place.element] : -1;
}

// The middle ray of what a block is counted from.
inline float4 middle_of(const Packet *p, int block)
{
    return p->rays->elements[OUTER > 1 ? p->group : block_element(p, block, 0, 0)];
}

// The rays about a place of the inner grid, `extent` columns and rows beyond `at`.
inline Bundle bundle_at(const Rays *rays, float4 middle, int2 at, float extent)
{
    const float2 grid = (float2)(rays->columns - 1, rays->rows - 1);
    const float2 c = convert_float2(at) + extent - 0.5f * grid;
    const float4 s = rays->step, first = fma(c.xyxy, s, middle);
    return (Bundle){first.x, first.y, first.z, first.w,
                    s.x, s.y, s.z, s.w, rays->outer.x, rays->outer.y, extent};
}

inline Bundle block_bundle(const Packet *p, int block)
{
    return bundle_at(p->rays, middle_of(p, block), block_position(p, block), p->rays->extent);
}

// One element's part of the packet, as if it were one block, and where a block lies from its
// centre.
inline Bundle element_bundle(const Packet *p, int block)
{
    return bundle_at(p->rays, middle_of(p, block), p->at, p->rays->element_extent);
}
inline float2 block_offset(const Packet *p, int block)
{
    const Rays *r = p->rays;
    return convert_float2(r->block[block].at) + r->extent - r->element_extent;
}

inline Packet make_packet(const Rays *rays, int number)
{
    const int square = number % rays->squares;
    Packet p;
    p.rays = rays;
    p.group = number / rays->squares;
    p.element = rays->groups + p.group * rays->group * rays->group;
    p.at = (int2)(square % rays->across, square / rays->across) * rays->packet_side;
    p.blocks = 0;
    for (int block = 0; block < rays->blocks; ++block) {
        const int2 at = block_position(&p, block);
        const int there = OUTER > 1 || block_element(&p, block, 0, 0) >= 0;
        if (there && at.x < rays->columns && at.y < rays->rows) p.blocks |= 1u << block;
    }
    return p;
}

// The first element of a packet; negative if it has none.
inline int first_element(const Packet *p)
{
    for (int k = 0; k < p->rays->group * p->rays->group; ++k)
        if (p->element[k] >= 0) return p->element[k];
    return -1;
}

// What holds every ray of the packet.
inline Frustum packet_frustum(const Packet *p)
{
    const Rays *r = p->rays;
    float4 lo = FAR, hi = -FAR;
    for (int block = 0; block < r->blocks; ++block) {
        if (OUTER == 1 && block_element(p, block, 0, 0) < 0) continue;
        lo = min(lo, middle_of(p, block));
        hi = max(hi, middle_of(p, block));
    }
    const Bundle first = bundle_at(r, lo, p->at, r->element_extent);
    const Bundle last = bundle_at(r, hi, p->at, r->element_extent);
    return make_frustum(&first, &last);
}

#endif
