// Traced rays as the frames of video files: their light and, if asked for, codes of their depth.
// What the host would make of them has other bits on each kind of processor, whose powers differ.
#include "colours.cl"
#include "frames.cl"

// Codes of depths z, in even steps of inverse depth from the farthest on.
#define TO_CODES(n) JOIN(convert_, JOIN(CODE, n))
#define CODES_OF(n, z) \
    TO_CODES(n)(rint(clamp((1.0f / (z) - rays.far) * rays.steps, 0.0f, rays.last_code)))

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
KERNEL void encode_rows(encode_rows_PARAMETERS)
{
    const int y0 = get_global_id(0) * BLOCK, element = get_global_id(1);
    const ulong worker = (ulong)element * get_global_size(0) + get_global_id(0);
    global float *colours = scratch + worker * COLOURS;
    const Frames out = {placements, frames, &format};
    for (int x = 0; x < rays.columns; x += BLOCK) {
        const int2 inside = (int2)(min(BLOCK, rays.columns - x), min(BLOCK, rays.rows - y0));
        for (int y = 0; y < inside.y; ++y) {
            const ulong at = ((ulong)element * rays.rows + y0 + y) * rays.columns + x;
            load_colours(light + 3 * at, inside.x, colours + y * BLOCK);
            if (!codes) continue;
            const Placement code = code_placements[element];
            const int row = code.y + rays.first_row + y0 + y;
            const ulong line = (ulong)code.frame * code_format.height + row;
            global CODE *to = codes + line * code_format.width + code.x + x;
            if (inside.x == BLOCK) vstore16(CODES_OF(16, vload16(0, depth + at)), 0, to);
            else for (int k = 0; k < inside.x; ++k) to[k] = CODES_OF(, depth[at + k]);
        }
        write_frames(&out, element, (int2)(x, rays.first_row + y0), inside, colours);
    }
}
