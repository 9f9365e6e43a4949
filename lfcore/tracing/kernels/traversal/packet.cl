// Packets of blocks: the unit of work that one worker takes at a time.
//
// A packet is a square of neighbouring elements (pixels, lens samples, data cameras) times a square
// of blocks of the inner grid.  Blocks of one element are sorted by element; a block of several
// elements has all of the packet's.
#pragma once
#include "walk.cl"

#define MOST_BLOCKS 16  // of a packet

// A block in its packet: its (first) element's index in the group, first column and row.
typedef struct { int element; int2 at; } BlockOffset;

// The rays of a job: the outer elements, and the inner grid that all of them share.
typedef struct {
    global const float4 *centre_rays;  // (E,) ox, oy, dx, dy; (B,) if blocks span elements
    global const int *members;      // (B, group_side^2) the groups' elements, or -1
    float4 step;                    // sx, sy, tx, ty: per column and row of the inner grid
    float2 outer;                   // a, b: per element of a block
    int columns, rows, first_row, end_row;  // size of the inner grid, traced rows
    float half_extent;              // of a block, as in Bundle
    float element_half_extent;      // of one element's part of a packet
    int group_side;                 // elements along a side of a packet
    int side, packet_side;          // blocks and rays along a side of one element's part
    int blocks;                     // in a packet
    BlockOffset block[MOST_BLOCKS];
    int packets_in_x, packets_per_group;  // of one group's inner grid
} Rays;

// Offsets of `side` x `side` squares of rays for each element; returns their number.
inline int make_offsets(int elements, int side, int size, BlockOffset *out)
{
    int count = 0;
    for (int element = 0; element < elements; ++element)
        for (int y = 0; y < side; ++y)
            for (int x = 0; x < side; ++x)
                out[count++] = (BlockOffset){element, (int2)(x, y) * size};
    return count;
}

inline Rays make_rays(global const float4 *centre_rays, global const int *members,
                      const RayArguments *a)
{
    const int size = a->side * INNER, all = a->group_side * a->group_side;
    Rays r = {.centre_rays = centre_rays, .members = members, .step = vload4(0, a->step),
              .outer = vload2(0, a->outer), .columns = a->columns, .rows = a->rows,
              .first_row = a->first_row, .end_row = a->end_row, .half_extent = a->half_extent,
              .element_half_extent = 0.5f * (size - INNER) + a->half_extent,
              .group_side = a->group_side, .side = a->side, .packet_side = size};
    r.blocks = make_offsets(OUTER > 1 ? 1 : all, a->side, INNER, r.block);
    r.packets_in_x = (a->columns + size - 1) / size;
    r.packets_per_group = r.packets_in_x * ((a->end_row - a->first_row + size - 1) / size);
    return r;
}

typedef struct {
    const Rays *rays;
    int group;                  // number of its group of elements
    global const int *members;  // (group_side^2,) elements or -1
    int2 at;                    // first column and row of the inner grid
    uint blocks;                // a bit per block with rays to trace
} Packet;

// First column and row of a block in the inner grid.
inline int2 block_position(const Packet *p, int block) { return p->at + p->rays->block[block].at; }

// The numbers of a block's columns and rows that are in the inner grid and traced.
inline int2 block_inside(const Packet *p, int block)
{
    const int2 grid = (int2)(p->rays->columns, p->rays->end_row);
    return clamp(grid - block_position(p, block), 0, INNER);
}

inline int has_block(const Packet *p, int block) { return p->blocks >> block & 1; }

// The element of part `part` of a block's OUTER x OUTER, or -1.
inline int block_element(const Packet *p, int block, int part)
{
    return p->members[OUTER > 1 ? part : p->rays->block[block].element];
}

// The centre ray that a block's offsets are relative to.
inline float4 centre_ray_of(const Packet *p, int block)
{
    return p->rays->centre_rays[OUTER > 1 ? p->group : block_element(p, block, 0)];
}

// The inner rays from column and row `at` on, within `half_extent` of their centre.
inline Bundle bundle_at(const Rays *rays, float4 centre_ray, int2 at, float half_extent)
{
    const float2 grid = (float2)(rays->columns - 1, rays->rows - 1);
    const float2 c = convert_float2(at) + half_extent - 0.5f * grid;
    const float4 s = rays->step, centre = fma(c.xyxy, s, centre_ray);
    return (Bundle){centre.x, centre.y, centre.z, centre.w,
                    s.x, s.y, s.z, s.w, rays->outer.x, rays->outer.y, half_extent};
}

inline Bundle block_bundle(const Packet *p, int block)
{
    const float4 centre = centre_ray_of(p, block);
    return bundle_at(p->rays, centre, block_position(p, block), p->rays->half_extent);
}

// The first element of a packet; negative if it has none.
inline int first_element(const Packet *p)
{
    for (int k = 0; k < p->rays->group_side * p->rays->group_side; ++k)
        if (p->members[k] >= 0) return p->members[k];
    return -1;
}

inline Packet make_packet(const Rays *rays, int packet)
{
    const int number = packet % rays->packets_per_group;
    Packet p;
    p.rays = rays;
    p.group = packet / rays->packets_per_group;
    p.members = rays->members + p.group * rays->group_side * rays->group_side;
    p.at = (int2)(number % rays->packets_in_x, number / rays->packets_in_x) * rays->packet_side;
    p.at.y += rays->first_row;
    p.blocks = 0;
    const int first = first_element(&p);
    for (int block = 0; block < rays->blocks; ++block) {
        const int2 at = block_position(&p, block);
        const int there = OUTER > 1 ? first >= 0 : block_element(&p, block, 0) >= 0;
        if (there && at.x < rays->columns && at.y < rays->end_row) p.blocks |= 1u << block;
    }
    return p;
}

inline Frustum packet_frustum(const Packet *p)
{
    const Rays *r = p->rays;
    float4 lo = FAR, hi = -FAR;
    for (int block = 0; block < r->blocks; ++block) {
        if (OUTER == 1 && block_element(p, block, 0) < 0) continue;
        lo = min(lo, centre_ray_of(p, block));
        hi = max(hi, centre_ray_of(p, block));
    }
    const Bundle first = bundle_at(r, lo, p->at, r->element_half_extent);
    const Bundle last = bundle_at(r, hi, p->at, r->element_half_extent);
    return make_frustum(&first, &last);
}
