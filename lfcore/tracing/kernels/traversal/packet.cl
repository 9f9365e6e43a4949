// Packets of blocks: the unit of work that one worker takes at a time.
//
// A packet is a square of neighbouring blocks of the inner grid, of one element (a pixel, lens sample
// or data camera) or of OUTER x OUTER elements.
#pragma once
#include "walk.cl"

#define MOST_BLOCKS 16  // of a packet

// The rays of a job: the outer elements, and the inner grid that all of them share.
typedef struct {
    global const float4 *centre_rays;  // (B,) of each group of elements: ox, oy, dx, dy
    global const int *members;      // (B, OUTER^2) the groups' elements, or -1
    float4 step;                    // sx, sy, tx, ty: per column and row of the inner grid
    float2 outer;                   // a, b: per element of a block
    int columns, rows, first_row, end_row;  // size of the inner grid, traced rows
    float half_extent;              // of a block, as in Bundle
    int side, blocks;               // blocks along a side of a packet, and in a packet
    int packets_in_x, packets_per_group;  // of one group's inner grid
} Rays;

inline Rays make_rays(global const float4 *centre_rays, global const int *members,
                      const RayArguments *a)
{
    const int size = a->side * INNER, packets_in_x = (a->columns + size - 1) / size;
    return (Rays){
        .centre_rays = centre_rays, .members = members, .step = vload4(0, a->step),
        .outer = vload2(0, a->outer), .columns = a->columns, .rows = a->rows,
        .first_row = a->first_row, .end_row = a->end_row, .half_extent = a->half_extent,
        .side = a->side, .blocks = a->side * a->side, .packets_in_x = packets_in_x,
        .packets_per_group = packets_in_x * ((a->end_row - a->first_row + size - 1) / size)};
}

typedef struct {
    const Rays *rays;
    float4 centre_ray;          // that offsets are relative to
    global const int *members;  // (OUTER^2,) elements or -1
    int2 at;                    // first column and row of the inner grid
} Packet;

// First column and row of a block in the inner grid.
inline int2 block_position(const Packet *p, int block)
{
    return p->at + (int2)(block % p->rays->side, block / p->rays->side) * INNER;
}

// The numbers of a block's columns and rows that are in the inner grid and traced.
inline int2 block_inside(const Packet *p, int block)
{
    const int2 grid = (int2)(p->rays->columns, p->rays->end_row);
    return clamp(grid - block_position(p, block), 0, INNER);
}

// Whether a block has rays to trace.
inline int has_block(const Packet *p, int block) { return all(block_inside(p, block) > 0); }

// The inner rays from column and row `at` on, within `half_extent` of their centre.
inline Bundle bundle_at(const Packet *p, int2 at, float half_extent)
{
    const Rays *r = p->rays;
    const float2 grid = (float2)(r->columns - 1, r->rows - 1);
    const float2 c = convert_float2(at) + half_extent - 0.5f * grid;
    const float4 s = r->step, centre = fma(c.xyxy, s, p->centre_ray);
    return (Bundle){.ox = centre.x, .oy = centre.y, .dx = centre.z, .dy = centre.w,
                    .sx = s.x, .sy = s.y, .tx = s.z, .ty = s.w,
                    .a = r->outer.x, .b = r->outer.y, .half_extent = half_extent};
}

inline Bundle block_bundle(const Packet *p, int block)
{
    return bundle_at(p, block_position(p, block), p->rays->half_extent);
}

inline Packet make_packet(const Rays *r, int packet)
{
    const int number = packet % r->packets_per_group, group = packet / r->packets_per_group;
    int2 at = (int2)(number % r->packets_in_x, number / r->packets_in_x) * (r->side * INNER);
    at.y += r->first_row;
    return (Packet){.rays = r, .centre_ray = r->centre_rays[group],
                    .members = r->members + group * OUTER * OUTER, .at = at};
}

inline Frustum packet_frustum(const Packet *p)
{
    const float half_extent = 0.5f * (p->rays->side - 1) * INNER + p->rays->half_extent;
    const Bundle all = bundle_at(p, p->at, half_extent);
    return make_frustum(&all);
}
