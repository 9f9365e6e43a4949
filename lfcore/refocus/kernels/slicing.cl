// Algorithm 4: sensor planes from decoded frames.
//
// BITS is 8 or 10 (in 16-bit samples), CHROMA 1 (4:4:4) or 2 (4:2:0), RGB 1 for planar green, blue, red.
// VIEWS says that a frame's inner grid is a view, not a macropixel.
#include "planes.cl"

#if BITS == 8
typedef uchar sample;
#define SCALE 1.0f
#else
typedef ushort sample;
#define SCALE (1.0f / (1 << (BITS - 8)))
#endif

// IEC 61966-2-1 decoding of values in [0, 1].
inline vf decode_srgb(vf x)
{
    const vf curve = exp2_fast(log2_fast((x + 0.055f) * (1.0f / 1.055f)) * 2.4f);
    return pick(x * (1.0f / 12.92f), curve, GT(x, (vf)(0.04045f)));
}

inline vf load_row(global const sample *at, int step, int count)
{
    private float row[LANES];
    for (int k = 0; k < LANES; ++k) row[k] = (float)at[min(k, count - 1) / step] * SCALE;
    return VLOAD(row);
}

// Decode a block to linear colours (3, BLOCK_RAYS); rays beyond columns and rows repeat the last.
inline void load_block(global const sample *frame, int width, int height, int x0, int y0, int columns, int rows, global float *colours)
{
    const ulong pixels = (ulong)width * height, chroma = pixels / (CHROMA * CHROMA);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const int x = min(at % BLOCK, columns - 1), y = min(at / BLOCK, rows - 1), count = max(1, columns - x);
        const vf first = load_row(frame + (ulong)(y0 + y) * width + x0 + x, 1, count);
        global const sample *small = frame + pixels + (ulong)((y0 + y) / CHROMA) * (width / CHROMA) + (x0 + x) / CHROMA;
        const vf second = load_row(small, CHROMA, count), third = load_row(small + chroma, CHROMA, count);
#if RGB
        const vf g = first * (1.0f / 255.0f), b = second * (1.0f / 255.0f), r = third * (1.0f / 255.0f);
#else
        const vf luma = (first - 16.0f) * (1.0f / 219.0f), cb = (second - 128.0f) * (1.0f / 224.0f), cr = (third - 128.0f) * (1.0f / 224.0f);
        const vf r = fma(cr, (vf)(1.5748f), luma), b = fma(cb, (vf)(1.8556f), luma);
        const vf g = (luma - 0.2126f * r - 0.0722f * b) * (1.0f / 0.7152f);
#endif
        VSTORE(decode_srgb(clamp(r, (vf)(0.0f), (vf)(1.0f))), colours + at);
        VSTORE(decode_srgb(clamp(g, (vf)(0.0f), (vf)(1.0f))), colours + BLOCK_RAYS + at);
        VSTORE(decode_srgb(clamp(b, (vf)(0.0f), (vf)(1.0f))), colours + 2 * BLOCK_RAYS + at);
    }
}

#define SCRATCH_WORDS (6 * BLOCK_RAYS + TABLE_WORDS)

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void form_planes(global const sample *restrict frames,
                 const int frame_width,
                 const int frame_height,
                 global const int4 *restrict places,  // (E,) frame, x0, y0, outer column + (row << 16)
                 const int n_elements,
                 const int inner,                     // side of the inner grid
                 global int *restrict next,
                 global uint *restrict scratch,       // (workers, SCRATCH_WORDS)
                 const int n_planes,
                 const int8 region,                   // left, top, width, height, size M, blocks, views N, 0
                 global const int4 *restrict plane_info,
                 global const int *restrict runs,
                 global const uchar *restrict masks,
                 global const uchar *restrict kinds,
                 global ulong4 *restrict sums)
{
    const Planes planes = {n_planes, region.s5, region.s0, region.s1, region.s2, region.s3, region.s4, plane_info, runs, masks, kinds,
                           sums + get_global_id(0) * (ulong)n_planes * region.s2 * region.s3};
    global float *colours = (global float *)(scratch + get_global_id(0) * (ulong)SCRATCH_WORDS);
    global uint *fixed = (global uint *)(colours + 3 * BLOCK_RAYS), *table = fixed + 3 * BLOCK_RAYS;
    const ulong frame_samples = (ulong)frame_width * frame_height + 2 * (ulong)(frame_width / CHROMA) * (frame_height / CHROMA);
    for (int element = atomic_inc(next); element < n_elements; element = atomic_inc(next)) {
        const int4 place = places[element];
        global const sample *frame = frames + place.x * frame_samples;
        for (int y = 0; y < inner; y += BLOCK)
            for (int x = 0; x < inner; x += BLOCK) {
#if VIEWS
                load_block(frame, frame_width, frame_height, place.y + x, place.z + y, inner - x, inner - y, colours);
                add_view_to_planes(&planes, place.w & 0xffff, place.w >> 16, region.s6, x, y, colours);
#else
                int open = 0;
                for (int plane = 0; plane < n_planes; ++plane)
                    open |= kinds[(plane_info[plane].x * region.s5 + y / BLOCK) * region.s5 + x / BLOCK];
                if (!open) continue;
                load_block(frame, frame_width, frame_height, place.y + x, place.z + y, inner - x, inner - y, colours);
                add_to_planes(&planes, place.w & 0xffff, place.w >> 16, x / BLOCK, y / BLOCK, inner, inner, colours, fixed, table);
#endif
            }
    }
}
