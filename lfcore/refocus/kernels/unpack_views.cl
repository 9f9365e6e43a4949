// Views in fixed-point light, unpacked from video frames.  BITS, CHROMA, RGB and PQ are as in
// light.cl; VIEWS is 1 if frames hold views, 0 for macropixels.
#include "light.cl"

// One ray of frames to red, green, blue of a planar view.
inline void unpack(global const sample *frame, int width, int height, int x, int y,
                   global uint *out, ulong plane)
{
    const ulong pixels = (ulong)width * height, chroma = pixels / (CHROMA * CHROMA);
    const ulong line = y / CHROMA;
    global const sample *small = frame + pixels + line * (width / CHROMA) + x / CHROMA;
    const float first = frame[(ulong)y * width + x] * SCALE;
    const float second = small[0] * SCALE, third = small[chroma] * SCALE;
    TO_RGB(float, first, second, third, r, g, b);
    private uint light[3];
    linear_ray(r, g, b, light);
    for (int channel = 0; channel < 3; ++channel) out[channel * plane] = light[channel];
}

// Views (K, 3, height, width) of the pixels of one tile, from frames that hold all their rays.
kernel void unpack_views(unpack_views_PARAMETERS)
{
    const int frame_width = numbers.frame_width, frame_height = numbers.frame_height;
    const int width = numbers.width;
    const ulong chroma = (ulong)(frame_width / CHROMA) * (frame_height / CHROMA);
    const ulong frame_samples = (ulong)frame_width * frame_height + 2 * chroma;
    const ulong plane = (ulong)width * numbers.height;
#if VIEWS
    const int x = get_global_id(0), y = get_global_id(1), k = get_global_id(2);
    const Placement place = placements[k];
    const int2 at = (int2)(place.x + x, place.y + y);
#else
    // Lens samples innermost: they are neighbours in a frame.
    const int k = get_global_id(0), x = get_global_id(1), y = get_global_id(2);
    const Placement place = placements[y * width + x];
    const int2 at = (int2)(place.x, place.y) + samples[k];
#endif
    global uint *out = views + k * 3 * plane + (ulong)y * width + x;
    unpack(frames + place.frame * frame_samples, frame_width, frame_height, at.x, at.y, out, plane);
}
