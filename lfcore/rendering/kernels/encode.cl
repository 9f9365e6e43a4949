// Traced rays as the frames of video files: their light, and codes of their depth.  What the host would make of them
// has other bits on each kind of processor, whose powers differ.
#include "colours.cl"
#include "frames.cl"

// Codes of depths z, in even steps of inverse depth from `far` on.
#define CODES_OF(n, z) JOIN(convert_, JOIN(CODE, n))(rint(clamp((1.0f / (z) - far) * steps, 0.0f, (float)(LAST_CODE))))

// BLOCK rows of an element, a block after the other, by each work-item.
KERNEL
void encode_rows(global const float *restrict light,  // (E, rows, columns, 3)
                 global const float *restrict depth,  // (E, rows, columns), metres
                 const int columns,
                 const int rows,
                 const int first_row,                 // of the elements
                 const FrameArguments numbers,
                 global const Placement *restrict placements,  // (E,)
                 global sample *restrict frames,
                 const FrameArguments code_numbers,
                 global const Placement *restrict code_placements,
                 global CODE *restrict codes,
                 const float far,
                 const float steps,
                 global float *restrict scratch)      // COLOURS for each work-item
{
    const int y0 = get_global_id(0) * BLOCK, element = get_global_id(1);
    global float *colours = scratch + (element * get_global_size(0) + get_global_id(0)) * COLOURS;
    const Frames out = {placements, frames, &numbers};
    const Placement code = code_placements[element];
    for (int x = 0; x < columns; x += BLOCK) {
        const int2 inside = (int2)(min(BLOCK, columns - x), min(BLOCK, rows - y0));
        for (int y = 0; y < inside.y; ++y) {
            const ulong at = ((ulong)element * rows + y0 + y) * columns + x;
            const ulong line = (ulong)code.frame * code_numbers.height + code.y + first_row + y0 + y;
            global CODE *to = codes + line * code_numbers.width + code.x + x;
            if (inside.x == BLOCK) {
                float16 of[3];
                split_colours(light + 3 * at, of);
                for (int c = 0; c < 3; ++c) vstore16(of[c], 0, colours + c * BLOCK_RAYS + y * BLOCK);
                vstore16(CODES_OF(16, vload16(0, depth + at)), 0, to);
                continue;
            }
            for (int k = 0; k < inside.x; ++k) {
                for (int c = 0; c < 3; ++c) colours[c * BLOCK_RAYS + y * BLOCK + k] = light[3 * (at + k) + c];
                to[k] = CODES_OF(, depth[at + k]);
            }
        }
        write_frames(&out, element, (int2)(x, first_row + y0), inside, colours);
    }
}
