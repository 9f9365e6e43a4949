// Colours of 16 rays, between r g b per ray and one vector per channel.
#pragma once

inline void split_colours(global const float *light, float16 channel[3])
{
    const uint16 r = (uint16)(0, 3, 6, 9, 12, 15, 18, 21, 24, 27, 30, 0, 0, 0, 0, 0);
    const uint16 r2 = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 17, 20, 23, 26, 29);
    const uint16 g = (uint16)(1, 4, 7, 10, 13, 16, 19, 22, 25, 28, 31, 0, 0, 0, 0, 0);
    const uint16 g2 = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 18, 21, 24, 27, 30);
    const uint16 b = (uint16)(2, 5, 8, 11, 14, 17, 20, 23, 26, 29, 0, 0, 0, 0, 0, 0);
    const uint16 b2 = (uint16)(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 16, 19, 22, 25, 28, 31);
    const float16 x = vload16(0, light), y = vload16(1, light), w = vload16(2, light);
    channel[0] = shuffle2(shuffle2(x, y, r), w, r2);
    channel[1] = shuffle2(shuffle2(x, y, g), w, g2);
    channel[2] = shuffle2(shuffle2(x, y, b), w, b2);
}

// The inverse: r g b per ray, in three vectors one after the other.
inline void interleave_colours(float16 r, float16 g, float16 b, float16 light[3])
{
    const uint16 rg0 = (uint16)(0, 16, 0, 1, 17, 0, 2, 18, 0, 3, 19, 0, 4, 20, 0, 5);
    const uint16 b0 = (uint16)(0, 1, 16, 3, 4, 17, 6, 7, 18, 9, 10, 19, 12, 13, 20, 15);
    const uint16 rg1 = (uint16)(21, 0, 6, 22, 0, 7, 23, 0, 8, 24, 0, 9, 25, 0, 10, 26);
    const uint16 b1 = (uint16)(0, 21, 2, 3, 22, 5, 6, 23, 8, 9, 24, 11, 12, 25, 14, 15);
    const uint16 rg2 = (uint16)(0, 11, 27, 0, 12, 28, 0, 13, 29, 0, 14, 30, 0, 15, 31, 0);
    const uint16 b2 = (uint16)(26, 1, 2, 27, 4, 5, 28, 7, 8, 29, 10, 11, 30, 13, 14, 31);
    light[0] = shuffle2(shuffle2(r, g, rg0), b, b0);
    light[1] = shuffle2(shuffle2(r, g, rg1), b, b1);
    light[2] = shuffle2(shuffle2(r, g, rg2), b, b2);
}
