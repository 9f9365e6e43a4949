// Views in fixed-point light, unpacked from video frames of views or of macropixels.
#include "light.cl"

// One ray of frames to red, green, blue of a planar view.
inline void unpack(const UnpackingArguments *n, global const sample *frame, int x, int y,
                   global uint *out, ulong plane)
{
    const int width = n->frame_width, halved = n->halved;
    const ulong pixels = (ulong)width * n->frame_height, chroma = pixels >> 2 * halved;
    const ulong line = y >> halved;
    global const sample *small = frame + pixels + line * (width >> halved) + (x >> halved);
    const float first = frame[(ulong)y * width + x] * SCALE;
    const float second = small[0] * SCALE, third = small[chroma] * SCALE;
    TO_RGB(float, n->is_rgb, first, second, third, r, g, b);
    private uint light[3];
    linear_ray(r, g, b, light);
    for (int channel = 0; channel < 3; ++channel) out[channel * plane] = light[channel];
}

// Views (K, 3, height, width) of the pixels of one tile, from frames that hold all their rays.
kernel void unpack_views(unpack_views_PARAMETERS)
{
    const int width = numbers.width, by_views = numbers.by_views;
    const ulong pixels = (ulong)numbers.frame_width * numbers.frame_height;
    const ulong frame_samples = pixels + 2 * (pixels >> 2 * numbers.halved);
    const ulong plane = (ulong)width * numbers.height;
    const int3 id = (int3)(get_global_id(0), get_global_id(1), get_global_id(2));
    // Of macropixels lens samples innermost: they are neighbours in a frame.
    const int k = by_views ? id.z : id.x;
    const int2 pixel = by_views ? id.xy : id.yz;
    const Placement place = placements[by_views ? k : pixel.y * width + pixel.x];
    const int2 at = (int2)(place.x, place.y) + (by_views ? pixel : samples[k]);
    global uint *out = views + k * 3 * plane + (ulong)pixel.y * width + pixel.x;
    unpack(&numbers, frames + place.frame * frame_samples, at.x, at.y, out, plane);
}
