// Triangles and depths of hits: of a block, and of rays that are no bundle.
#pragma once
#include "visibility.cl"

// Where a row of an element is in the results, which have the traced rows of one after the other.
inline ulong result_row(const Rays *rays, int element, int row)
{
    return (ulong)element * (rays->end_row - rays->first_row) + row - rays->first_row;
}

// Write a number of each of a block's rays, which has `from` row by row: element after element.
inline void write_rays(const Packet *p, int block, global const uint *from, global uint *to)
{
    const Rays *rays = p->rays;
    const int2 where = block_position(p, block), inside = block_inside(p, block);
    for (int part = 0; part < OUTER * OUTER; ++part) {
        const int element = block_element(p, block, part);
        if (element < 0) continue;
        global const uint *row = from + first_ray(part);
        global uint *out = to + result_row(rays, element, where.y) * rays->columns + where.x;
        for (int y = 0; y < inside.y; ++y, row += BLOCK, out += rays->columns)
            if (inside.x == INNER)
                for (int k = 0; k < INNER; k += 4) vstore4(vload4(0, row + k), 0, out + k);
            else
                for (int k = 0; k < inside.x; ++k) out[k] = row[k];
    }
}

inline void write_depths(const Packet *p, int block, Coverage *c, global float *depth)
{
    use_buffer(c);
    write_rays(p, block, (global const uint *)c->z, (global uint *)depth);
}

// Follow the rays of a packet that is no bundle: the columns of one element are their numbers.
// `origins`, `directions`, `weights`: (R, 3).  Depth is the parameter of the ray as given.
inline void hit_given_rays(const Tree *tree, const Packet *p, global const float *origins,
                           global const float *directions, global int *triangle,
                           global float *depth, global float *weights)
{
    const int end = min(p->at.x + p->rays->packet_side, p->rays->columns);
    for (int ray = p->at.x; ray < end; ++ray) {
        const float3 o = vload3(ray, origins), d = vload3(ray, directions);
        const int has_way = all(isfinite(o)) && all(isfinite(d)) && any(d != 0.0f);
        const Hit hit = has_way ? closest_hit(tree, o, d) : MISS;
        triangle[ray] = hit.id;
        depth[ray] = hit.t;
        vstore3(hit.weights, ray, weights);
    }
}
