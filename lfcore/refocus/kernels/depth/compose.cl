// Pictures from the sums of their layers, which are composed from front to back.
#include "sums.cl"

// The last row of a wide layer that row `y` of a strip needs.
inline int last_row(int layer, int y) { return is_half(layer) ? (y + 1) / 2 + 1 : y; }

// Sum the differences of a wide layer up to the rows that row `y` of the strip needs.  The first
// two rows of the layer hold the running sums in turn: pages that are only read take no memory.
inline void integrate(const Strip *s, int layer, int y)
{
    const int pitch = pitch_of(s, layer);
    for (int row = y ? last_row(layer, y - 1) + 1 : 0; row <= last_row(layer, y); ++row) {
        global sum4 *from = s->sums[layer] + row * pitch, *to = s->sums[layer] + row % 2 * pitch;
        global const sum4 *before = s->sums[layer] + (row + 1) % 2 * pitch;
        sum4 along = 0;
        for (int x = 0; x < pitch - 1; ++x) {
            along += from[x];
            to[x] = row ? before[x] + along : along;
        }
    }
}

// Integrate a layer in use, as far as it has differences.
inline void integrate_used(const Strip *s, int used, int layer, int y)
{
    if (is_wide(layer)) integrate(s, layer, y);
    else if (LARGE_LAYERS && used >> LARGE_OF(layer) & 1) integrate(s, LARGE_OF(layer), y);
}

// Light of a pixel of a layer.  In halved layers, a pixel of the picture is between two pixels
// along each axis, whose weights are 3/4 and 1/4.
inline float4 light_at(const Strip *s, int used, int layer, int x, int y)
{
    const int pitch = pitch_of(s, layer);
    global const sum4 *sums = s->sums[layer];
    if (!is_half(layer)) {
        sum4 light = sums[(is_wide(layer) ? y & 1 : y) * pitch + x];
        if (LARGE_LAYERS && !is_wide(layer) && used >> LARGE_OF(layer) & 1)
            light += s->sums[LARGE_OF(layer)][(y & 1) * pitch + x];
        return convert_float4(light);
    }
    const int column = x / 2 + 1, row = y / 2 + 1, beside = column + (x % 2 ? 1 : -1);
    global const sum4 *near = sums + row % 2 * pitch, *far = sums + (row + 1) % 2 * pitch;
    const float4 sides = convert_float4(near[beside]) + convert_float4(far[column]);
    return (convert_float4(near[column]) * 9.0f + sides * 3.0f + convert_float4(far[beside])) *
           0.0625f;
}

// The colour of a reflection; where no ray of its picture fell, of specular light at the surface's
// depth.
inline float3 specular_colour(float4 covered, float3 reflection)
{
    return isnan(reflection.x) ? covered.xyz / covered.w : reflection;
}

// The sheets of a strip, and the bits of their layers that have light.
typedef struct { Strip sheets[SHEETS]; int used[SHEETS], any, apart; } Sums;

inline Sums sums_of(global sum4 *sums, global const int *used, int plane,
                    const SlicingArguments *n)
{
    const int strip = get_global_id(0), strips = get_global_size(0);
    Sums s = {.any = 0, .apart = 0};
    for (int k = 0; k < SHEETS; ++k) {
        const int sheet = plane * SHEETS + k;
        s.sheets[k] = make_strip(sums, sheet, strip, n);
        s.used[k] = used[sheet * strips + strip];
        s.any |= s.used[k];
        if (k) s.apart |= s.used[k];
    }
    return s;
}

inline void integrate_sheets(const Sums *s, int layer, int y)
{
    for (int k = 0; k < SHEETS; ++k)
        if (s->used[k] >> layer & 1) integrate_used(s->sheets + k, s->used[k], layer, y);
}

// Light and weight of a layer's pixel; only those of a colour, of 3, are right.
inline float4 light_of(const Sums *s, int colour, int layer, int x, int y)
{
    float4 light = light_at(s->sheets, s->used[0], layer, x, y);
    if (SHEETS > 1 && s->used[colour + 1] >> layer & 1)
        light += light_at(s->sheets + colour + 1, s->used[colour + 1], layer, x, y);
    return light;
}

// Form the pixels of a strip from the sums: layers front to back, each covering at most the part of
// a pixel that nearer layers left open.  Beside an edge, light from behind is partly spread over
// the occluder, where it is lost.  So all layers but the first fill the open rest of a pixel, with
// at most the light that they have.  Near the ends of views, layers with wider sweeps have less
// weight.
//
// Pictures of two parts: `shown` are sums of the specular rays alone, at the depth of their
// surfaces.  Their part of a pixel's weight is the part that specular surfaces cover; there the
// pixel has the colour of `reflections`, too, which are sliced by virtual depth.
KERNEL void compose(compose_PARAMETERS)
{
    const int plane = get_global_id(1), width = numbers.width, height = numbers.height;
    const Sums s = sums_of(sums, used, plane, &numbers);
    const int two_parts = numbers.parts > 1;
    const Sums m = sums_of(two_parts ? shown : sums, two_parts ? shown_used : used, plane, &numbers);
    const float4 light = (float4)((float3)(numbers.white), 1.0f);
    const int shown_layers = two_parts ? m.any : 0;
    const int colours = s.apart | m.apart ? COLOURS : 1;
    int list[LAYERS], count = 0;
    for (int layer = 0; layer < LAYERS; ++layer) {
        list[count] = layer;
        count += s.any >> layer & 1;
    }
    const int top = s.sheets->top;
    for (int y = 0; y < s.sheets->rows; ++y) {
        for (int k = 0; k < count; ++k) {
            integrate_sheets(&s, list[k], y);
            if (shown_layers) integrate_sheets(&m, list[k], y);
        }
        for (int x = 0; x < width; ++x)
        for (int c = 0; c < colours; ++c) {
            float left = 1.0f;
            float4 total = 0.0f, first = 0.0f, covered = 0.0f, first_covered = 0.0f;
            for (int k = 0; k < count; ++k) {
                const int row = room_rows[list[k] * height + top + y];
                const float room = rooms[(ulong)row * width + x];
                const float4 units = light_of(&s, c, list[k], x, y);
                if (!(units.w >= LEAST_UNITS && room > 0.0f)) continue;
                const float4 found = units / (light * room);
                const float taken = min(found.w, left);
                total += found * (taken / found.w);
                if (shown_layers >> list[k] & 1)
                    covered += light_of(&m, c, list[k], x, y) / (light * room) * (taken / found.w);
                left -= taken;
                if (!(first.w > 0.0f)) {
                    first = total;
                    first_covered = covered;
                }
            }
            const float4 behind = total - first;
            if (behind.w > 0.0f) {
                const float more = min(left / behind.w, 1.0f);
                total += behind * more;
                covered += (covered - first_covered) * more;
            }
            const ulong at = (ulong)(top + y) * width + x;
            float3 colour = total.w > 0.0f ? total.xyz / total.w : numbers.empty;
            if (covered.w > 0.0f)
                colour += specular_colour(covered, vload3(at, reflections)) * (covered.w / total.w);
            if (colours == 1) vstore3(colour, at, picture);
            else picture[3 * at + c] = c == 0 ? colour.x : c == 1 ? colour.y : colour.z;
        }
    }
}
