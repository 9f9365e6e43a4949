// Algorithm 4: sensor planes from decoded frames that hold views.  BITS and RGB are as in light.cl,
// CHROMA is 1 (4:4:4) or 2 (4:2:0).
#include "light.cl"
#define ONE_OF_SUMS LIGHT_ONE
#define STOPS 0
#include "plane_sums.cl"

inline vf load_row(global const sample *at, int step, int count)
{
    private float row[LANES];
    for (int k = 0; k < LANES; ++k) row[k] = (float)at[min(k, count - 1) / step] * SCALE;
    return VLOAD(row);
}

// Decode a block to linear colours (3, BLOCK_RAYS); rays beyond columns and rows repeat the last.
inline void load_block(global const sample *frame,
                       int width,
                       int height,
                       int x0,
                       int y0,
                       int columns,
                       int rows,
                       global float *colours)
{
    const ulong pixels = (ulong)width * height, chroma = pixels / (CHROMA * CHROMA);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const int x = min(at % BLOCK, columns - 1), y = min(at / BLOCK, rows - 1), count = max(1, columns - x);
        const vf first = load_row(frame + (ulong)(y0 + y) * width + x0 + x, 1, count);
        global const sample *small = frame + pixels + (ulong)((y0 + y) / CHROMA) * (width / CHROMA) + (x0 + x) / CHROMA;
        const vf second = load_row(small, CHROMA, count), third = load_row(small + chroma, CHROMA, count);
        TO_RGB(vf, first, second, third, r, g, b);
        // Whole numbers of fixed point, as everywhere; dividing by a power of two keeps them so.
        VSTORE(TO_VF(linear_row(r)) / LIGHT_ONE, colours + at);
        VSTORE(TO_VF(linear_row(g)) / LIGHT_ONE, colours + BLOCK_RAYS + at);
        VSTORE(TO_VF(linear_row(b)) / LIGHT_ONE, colours + 2 * BLOCK_RAYS + at);
    }
}

KERNEL
void form_planes(global const sample *restrict frames,
                 const int frame_width,
                 const int frame_height,
                 global const Placement *restrict placements,  // (E,)
                 const int n_elements,
                 global int *restrict next,
                 global uint *restrict scratch,       // (workers, 3 * BLOCK_RAYS)
                 const int scratch_words,
                 const SensorPlaneArguments numbers,
                 global const SensorPlane *restrict plane_records,
                 global const int *restrict runs,
                 global const uchar *restrict masks,
                 global const uchar *restrict kinds,
                 global ulong4 *restrict sums)
{
    const ulong own = get_global_id(0) * (ulong)numbers.planes * numbers.width * numbers.height;
    const SensorPlanes planes = {&numbers, plane_records, runs, masks, kinds, sums + own};
    global float *colours = (global float *)(scratch + get_global_id(0) * (ulong)scratch_words);
    const ulong chroma = (ulong)(frame_width / CHROMA) * (frame_height / CHROMA);
    const ulong frame_samples = (ulong)frame_width * frame_height + 2 * chroma;
    for (int element = atomic_inc(next); element < n_elements; element = atomic_inc(next)) {
        const Placement placed = placements[element];
        global const sample *frame = frames + placed.frame * frame_samples;
        for (int y = 0; y < numbers.rows; y += BLOCK)
            for (int x = 0; x < numbers.columns; x += BLOCK) {
                load_block(frame, frame_width, frame_height, placed.x + x, placed.y + y, numbers.columns - x,
                           numbers.rows - y, colours);
                add_view(&planes, (int2)(placed.column, placed.row), (int2)(x, y), colours);
            }
    }
}
