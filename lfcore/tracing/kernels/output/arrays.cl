// Results in arrays: triangles, depths and linear colours, not clamped, of blocks and of given rays.
#pragma once
#include "colours.cl"
#include "given_hits.cl"
#include "shade.cl"
#include "visibility.cl"

// The number of an element's row in the results, which have the traced rows of all elements in
// turn.
inline ulong result_row(const Rays *rays, int element, int row)
{
    return (ulong)element * (rays->end_row - rays->first_row) + row - rays->first_row;
}

// The first ray of part `part` of a block's OUTER x OUTER elements.
inline int first_ray(int part) { return (part / OUTER * BLOCK + part % OUTER) * INNER; }

// Write a number per ray of a block, from rows of the block `from` to the elements' rows in `to`.
inline void write_rays(const Packet *p, int block, global const uint *from, global uint *to)
{
    const Rays *rays = p->rays;
    const int2 where = block_position(p, block), inside = block_inside(p, block);
    for (int part = 0; part < OUTER * OUTER; ++part) {
        const int element = p->members[part];
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

// Write a whole row of a block as 16 times r g b.
inline void write_row(global const float *c, int add, global float *to)
{
    float16 parts[3];
    interleave_colours(vload16(0, c), vload16(0, c + BLOCK_RAYS), vload16(0, c + 2 * BLOCK_RAYS),
                       parts);
    for (int k = 0; k < 3; ++k, to += BLOCK)
        vstore16(add ? parts[k] + vload16(0, to) : parts[k], 0, to);
}

// Write the block's colours inside the inner grid to `radiance` (E / across * rows, across *
// columns, 3), a mosaic of the elements' pictures: element e is in row e / across, column e % across.
// With `add` they are added to what is there.
inline void write_colours(const Packet *packet, int block, global const float *colours,
                          int across, int add, global float *radiance)
{
    const Rays *rays = packet->rays;
    const int2 where = block_position(packet, block), inside = block_inside(packet, block);
    const ulong pitch = 3 * (ulong)across * rays->columns;
    for (int part = 0; part < OUTER * OUTER; ++part) {
        const int element = packet->members[part];
        if (element < 0) continue;
        global const float *c = colours + first_ray(part);
        const ulong column = (ulong)(element % across) * rays->columns + where.x;
        global float *to = radiance + result_row(rays, element / across, where.y) * pitch +
                           3 * column;
        for (int y = 0; y < inside.y; ++y, c += BLOCK, to += pitch) {
            if (inside.x == BLOCK) {
                write_row(c, add, to);
                continue;
            }
            for (int x = 0; x < inside.x; ++x) {
                const float3 colour = (float3)(c[x], c[x + BLOCK_RAYS], c[x + 2 * BLOCK_RAYS]);
                vstore3(add ? vload3(x, to) + colour : colour, x, to);
            }
        }
    }
}

// The results of a sink; 0: not asked for.
typedef struct {
    global int *triangle;           // (E, rows, columns)
    global float *depth;            // (E, rows, columns)
    int across, add;                // of colours, as for write_colours
    global float *shaded[MOST_SHADED];  // (E, rows, columns, 3), as in shade.cl
} Arrays;

inline void write_arrays(const Packet *packet, int block, const Coverage *coverage,
                         global const float *shaded, const Arrays *to)
{
    for (int k = 0; k < SHADED && SINK != HITS; ++k)
        write_colours(packet, block, shaded + k * COLOURS, to->across, to->add, to->shaded[k]);
    if (to->depth) write_rays(packet, block, (global uint *)coverage->z, (global uint *)to->depth);
    if (to->triangle)
        write_rays(packet, block, (global uint *)coverage->ids, (global uint *)to->triangle);
}

// Write what given rays give, in their `order`, of which those from `end` on are none.
inline void write_given(global const int *order, int end, global const float *shaded,
                        const Arrays *to)
{
    for (int k = 0; k < SHADED; ++k, shaded += COLOURS) {
        if (!to->shaded[k]) continue;
        for (int at = 0; at < BLOCK_RAYS; ++at) {
            global const float *c = shaded + at;
            const float3 value = (float3)(c[0], c[BLOCK_RAYS], c[2 * BLOCK_RAYS]);
            if (order[at] < end) vstore3(value, order[at], to->shaded[k]);
        }
    }
}

// Find the first hits of given rays [first, end).  Depth is the parameter of the given ray.
inline void hit_given_rays(const Tree *tree, const GivenRays *rays, int first, int end)
{
    for (int ray = first; ray < end; ++ray) {
        const float3 o = vload3(ray, rays->origin), d = vload3(ray, rays->direction);
        const int is_valid = all(isfinite(o)) && all(isfinite(d)) && any(d != 0.0f);
        const Hit hit = is_valid ? closest_hit(tree, o, d) : MISS;
        rays->hits[ray].triangle = hit.id;
        rays->hits[ray].distance = hit.t;
        vstore3(hit.weights, 0, rays->hits[ray].weights);
    }
}
