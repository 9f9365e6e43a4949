// Linear radiance as floats: nothing is clamped.
//
// The image is a mosaic of the elements' pictures: element e is in row e / across, column e %
// across.
#pragma once
#include "hit_buffers.cl"

#define LINE 64   // bytes of a row of a block, and what stores past the caches must be aligned to

// A row of a block, of which all is inside the inner grid, as 16 times r g b.
inline void write_row(global const float *c, int mode, global float *to)
{
    const float16 r = vload16(0, c), g = vload16(0, c + BLOCK_RAYS);
    const float16 b = vload16(0, c + 2 * BLOCK_RAYS);
    const uint16 rg0 = (uint16)(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5);
    const uint16 b0 = (uint16)(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15);
    const uint16 rg1 = (uint16)(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26);
    const uint16 b1 = (uint16)(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15);
    const uint16 rg2 = (uint16)(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0);
    const uint16 b2 = (uint16)(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31);
    float16 parts[3] = {shuffle2(shuffle2(r, g, rg0), b, b0), shuffle2(shuffle2(r, g, rg1), b, b1),
                        shuffle2(shuffle2(r, g, rg2), b, b2)};
    const int past_caches = (mode & STREAM) && (ulong)to % LINE == 0;
    for (int k = 0; k < 3; ++k, to += BLOCK) {
        if (mode & ADD) parts[k] += vload16(0, to);
        if (past_caches) __builtin_nontemporal_store(parts[k], (global float16 *)to);
        else vstore16(parts[k], 0, to);
    }
}

// Write a block's colours, as far as the block lies in the inner grid, element after element to
// `radiance` (E / across * rows, across * columns, 3).
inline void write_radiance(const Packet *packet, int block, global const float *colours,
                           const ImageArguments *image, global float *radiance)
{
    const Rays *rays = packet->rays;
    const int across = image->across, mode = image->mode;
    const int2 where = block_position(packet, block), inside = block_inside(packet, block);
    const ulong pitch = 3 * (ulong)across * rays->columns;
    for (int part = 0; part < OUTER * OUTER; ++part) {
        const int element = block_element(packet, block, part);
        if (element < 0) continue;
        global const float *c = colours + first_ray(part);
        const ulong column = (ulong)(element % across) * rays->columns + where.x;
        global float *to = radiance + result_row(rays, element / across, where.y) * pitch +
                           3 * column;
        for (int y = 0; y < inside.y; ++y, c += BLOCK, to += pitch) {
            if (inside.x == BLOCK) {
                write_row(c, mode, to);
                continue;
            }
            for (int x = 0; x < inside.x; ++x) {
                const float3 colour = (float3)(c[x], c[x + BLOCK_RAYS], c[x + 2 * BLOCK_RAYS]);
                vstore3(mode & ADD ? vload3(x, to) + colour : colour, x, to);
            }
        }
    }
}
