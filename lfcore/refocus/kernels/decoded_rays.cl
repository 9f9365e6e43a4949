// Rays of a macropixel from decoded frames.
#pragma once
#include "light.cl"

typedef sample stored;

typedef struct {
    global const sample *first, *second, *third;  // planes of the frame
    int width;                                    // of a row of `first`
    int x0, y0;                                   // corner of the macropixel
    int halved;                                   // 1 for chroma of half the width and height
    int is_rgb;
} Macropixel;

inline Macropixel macropixel_at(global const sample *frames, const SensorPlaneArguments *n,
                                int element, Placement placed)
{
    const ulong pixels = (ulong)n->rays_width * n->rays_height, small = pixels >> 2 * n->halved;
    global const sample *frame = frames + placed.frame * (pixels + 2 * small);
    return (Macropixel){frame, frame + pixels, frame + pixels + small, n->rays_width,
                        placed.x, placed.y, n->halved, n->is_rgb};
}

#if LANES == 1
typedef sample samples;
#define DIFFERS(x) ((x) != 0)
#define TO_LIGHT(x) (convert_float(x) * SCALE)
#else
typedef SAMPLES(16) samples;
#define DIFFERS(x) any((x) != (sample)0)
#define TO_LIGHT(x) (convert_float16(x) * SCALE)
#endif

// The state of a run of LANES columns on its way down a strip.
typedef struct {
    samples first, second, third;  // of the row before
    vu r, g, b;                    // their fixed-point light
} Row;

// LANES samples of a row, all of them within the frame; of subsampled planes each twice.
inline samples load_samples(global const sample *at, int twice)
{
#if LANES == 1
    return *at;
#else
    if (twice) return vload8(0, at).s0011223344556677;
    return vload16(0, at);
#endif
}

// At the end of a macropixel's row, the last sample is repeated.
inline samples load_tail(global const sample *at, int twice, int count)
{
    private sample row[LANES];
    for (int k = 0; k < LANES; ++k) row[k] = at[min(k, count - 1) >> twice];
    return VLOAD(row);
}

// The light of row y from column x, `count` rays of them in the macropixel.  Neighbouring rows of
// smooth pictures are the same for many columns; decoding is expensive, so only changed columns are
// decoded.
inline void next_row(const Macropixel *m, int x, int y, int count, int begins, Row *row)
{
    const ulong full = (ulong)(m->y0 + y) * m->width + m->x0 + x;
    const int halved = m->halved;
    const ulong line = (m->y0 + y) >> halved;
    const ulong small = line * (m->width >> halved) + ((m->x0 + x) >> halved);
    samples first, second, third;
    if (count >= LANES) {
        first = load_samples(m->first + full, 0);
        second = load_samples(m->second + small, halved);
        third = load_samples(m->third + small, halved);
    } else {
        first = load_tail(m->first + full, 0, count);
        second = load_tail(m->second + small, halved, count);
        third = load_tail(m->third + small, halved, count);
    }
    const samples changed =
        (first ^ row->first) | (second ^ row->second) | (third ^ row->third);
    if (!begins && !DIFFERS(changed)) return;
    row->first = first, row->second = second, row->third = third;
    TO_RGB(vf, m->is_rgb, TO_LIGHT(first), TO_LIGHT(second), TO_LIGHT(third), red, green, blue);
    row->r = linear_row(red), row->g = linear_row(green), row->b = linear_row(blue);
}
