// Rays of a macropixel as they are traced: linear light, (E, side, side, 3).  Lens samples that all
// apertures stop may be omitted: the first `beside` columns and rows, and as many of the last.
#pragma once
#include "fixed_point.cl"

typedef float stored;

typedef struct {
    const SensorPlaneArguments *numbers;
    global const float *light;
    int beside, side;
} Macropixel;

inline Macropixel macropixel_at(global const float *light, const SensorPlaneArguments *n,
                                int element, Placement placed)
{
    const int side = n->rays_width;
    light += (ulong)element * 3 * side * side;
    return (Macropixel){n, light, (n->views - side) / 2, side};
}

// The fixed-point light of a run of LANES columns.
typedef struct { vu r, g, b; } Row;

inline vu fixed_row(const SensorPlaneArguments *n, vf light, int x)
{
    const vf held = clamp(light, (vf)(0.0f), (vf)(n->brightest));
    // By way of signed integers: every processor converts to them in one instruction.
    return AS_VU(TO_VI(fma(held, (vf)(n->one), halves_at(x, n->coarse))));
}

// The light of row y from column x, `count` rays of them in the macropixel; 0 where omitted.
inline void next_row(const Macropixel *m, int x, int y, int count, int begins, Row *row)
{
    *row = (Row){0, 0, 0};
    const int column = x - m->beside, line = y - m->beside;
    if (column < 0 || column >= m->side || line < 0 || line >= m->side) return;
    global const float *from = m->light + 3 * ((ulong)line * m->side + column);
#if LANES == 1
    const float of[3] = {from[0], from[1], from[2]};
#else
    float16 of[3];
    count = min(count, m->side - column);
    if (count >= LANES) {
        split_colours(from, of);
    } else {
        private float rest[3 * LANES] = {0};
        for (int k = 0; k < 3 * count; ++k) rest[k % 3 * LANES + k / 3] = from[k];
        for (int channel = 0; channel < 3; ++channel) of[channel] = VLOAD(rest + channel * LANES);
    }
#endif
    row->r = fixed_row(m->numbers, of[0], x), row->g = fixed_row(m->numbers, of[1], x);
    row->b = fixed_row(m->numbers, of[2], x);
}
