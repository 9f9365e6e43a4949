// Traced rays as the frames of video files: their light and, with DEPTH, codes of their depth.  What the host
// would make of them has other bits on each kind of processor, whose powers differ.
#include "colours.cl"
#include "frames.cl"

// Codes of depths z, in even steps of inverse depth from `far` on.
#define CODES_OF(n, z) JOIN(convert_, JOIN(CODE, n))(rint(clamp((1.0f / (z) - far) * steps, 0.0f, (float)(LAST_CODE))))

// Read a row of `count` rays into a block's.
inline void load_colours(global const float *light, int count, global float *colours)
{
    if (count == BLOCK) {
        float16 of[3];
        split_colours(light, of);
        for (int c = 0; c < 3; ++c) vstore16(of[c], 0, colours + c * BLOCK_RAYS);
        return;
    }
    for (int k = 0; k < 3 * count; ++k) colours[k % 3 * BLOCK_RAYS + k / 3] = light[k];
}

// BLOCK rows of an element, a block after the other, by each work-item.
KERNEL
void encode_rows(global const float *restrict light,  // (E, rows, columns, 3)
                 const int columns,
                 const int rows,
                 const int first_row,                 // of the elements
                 const FrameArguments numbers,
                 global const Placement *restrict placements,  // (E,)
                 global sample *restrict frames,
                 global float *restrict scratch       // COLOURS for each work-item
#if DEPTH
                 , global const float *restrict depth,  // (E, rows, columns), metres
                 const FrameArguments code_numbers,
                 global const Placement *restrict code_placements,
                 global CODE *restrict codes,
                 const float far,
                 const float steps
#endif
                 )
{
    const int y0 = get_global_id(0) * BLOCK, element = get_global_id(1);
    global float *colours = scratch + (element * get_global_size(0) + get_global_id(0)) * COLOURS;
    const Frames out = {placements, frames, &numbers};
    for (int x = 0; x < columns; x += BLOCK) {
        const int2 inside = (int2)(min(BLOCK, columns - x), min(BLOCK, rows - y0));
        for (int y = 0; y < inside.y; ++y) {
            const ulong at = ((ulong)element * rows + y0 + y) * columns + x;
            load_colours(light + 3 * at, inside.x, colours + y * BLOCK);
#if DEPTH
            const Placement code = code_placements[element];
            const ulong line = (ulong)code.frame * code_numbers.height + code.y + first_row + y0 + y;
            global CODE *to = codes + line * code_numbers.width + code.x + x;
            if (inside.x == BLOCK) vstore16(CODES_OF(16, vload16(0, depth + at)), 0, to);
            else for (int k = 0; k < inside.x; ++k) to[k] = CODES_OF(, depth[at + k]);
#endif
        }
        write_frames(&out, element, (int2)(x, first_row + y0), inside, colours);
    }
}
