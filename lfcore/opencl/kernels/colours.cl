// Red, green and blue of 16 rays, r g b each.
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
