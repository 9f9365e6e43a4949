// Average over film and lens samples of a thin lens; one work-item per pixel.
//
// A sampler is QUADRATURE (a fixed table), HALTON (a table with a random shift per pixel), STRATIFIED
// or INDEPENDENT, as in lfcore/refocus/array/sampling.py.

#include "lookup.cl"

inline uint hash32(uint x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ (x >> 16);
}

inline float uniform(uint pixel, uint index, uint dimension, uint seed)
{
    uint key = hash32(pixel + hash32(seed));
    key = hash32(key + index * 0x9e3779b9u);
    key = hash32(key + dimension);
    return (key >> 8) * 0x1p-24f;
}

inline float4 uniform4(uint pixel, uint index, uint seed)
{
    return (float4)(
        uniform(pixel, index, 0, seed),
        uniform(pixel, index, 1, seed),
        uniform(pixel, index, 2, seed),
        uniform(pixel, index, 3, seed));
}

inline float2 concentric_disk(float a, float b)
{
    const float x = 2.0f * a - 1.0f, y = 2.0f * b - 1.0f;
    const bool wide = fabs(x) > fabs(y);
    const float radius = wide ? x : y;
    const float ratio = (wide ? y : x) / (radius == 0.0f ? 1.0f : radius);
    const float angle = wide ? M_PI_4_F * ratio : M_PI_2_F - M_PI_4_F * ratio;
    float cosine;
    const float sine = sincos(angle, &cosine);
    return radius * (float2)(cosine, sine);
}

// A permutation of 0 ... count - 1 for every key; see sampling.permute.
inline uint permute(uint index, uint count, int bits, uint key)
{
    const uint mask = (1u << bits) - 1u;
    uint x = index;
    // Rounds permute 0 ... mask, so that the way from `index` comes back to it at the latest.
    for (uint step = 0; step <= mask; ++step) {
        uint mix = key;
        for (int round = 0; round < 4; ++round) {
            x = (x * (mix | 1u) + (mix >> 8)) & mask;
            x ^= x >> ((bits + 1) / 2);
            mix = hash32(mix);
        }
        if (x < count) break;
    }
    return x;
}

// Sample k of a pixel; `shift_by` of HALTON, `key` of STRATIFIED.
inline float4 sample_of(const Sampling *s, global const float4 *table, uint pixel, int k,
                        float4 shift_by, uint key)
{
    if (s->sampler == QUADRATURE) return table[k];
    if (s->sampler == HALTON) {
        const float4 moved = table[k] + shift_by;
        return moved - floor(moved);
    }
    float4 sample = uniform4(pixel, (uint)k, s->seed);
    if (s->sampler == STRATIFIED) {
        const int across = s->columns, down = s->rows;
        const int film = (int)permute((uint)k, (uint)s->count, s->film_bits, key);
        sample.x = (film % across + sample.x) / across;
        sample.y = (film / across + sample.y) / down;
        sample.z = (k % across + sample.z) / across;
        sample.w = (k / across + sample.w) / down;
    }
    return sample;
}

kernel void thin_lens(thin_lens_PARAMETERS)
{
    const int count = sampling.count;
    const int u = get_global_id(0);
    const int v = get_global_id(1) + first_row;
    if (u >= view.width || v >= view.height) {
        return;
    }
    const uint pixel = (uint)v * (uint)view.width + (uint)u;
    const float4 shift_by = uniform4(pixel, 0, sampling.seed);
    const uint key = (uint)(uniform(pixel, 0, 4, sampling.seed) * 16777216.0f);
    const float3 centre = view_position(&view);
    Sum total = sum_zero();
    for (int k = 0; k < count; ++k) {
        const float4 sample = sample_of(&sampling, table, pixel, k, shift_by, key);
        const float fu = u + sample.x, fv = v + sample.y;
        const float3 direction = view_direction(&view, fu, fv);
        const float q =
            surface_inverse_depth(&surface, map, &view, centre, direction, fu, fv);
        const float2 lens = view.lens_radius * concentric_disk(sample.z, sample.w);
        const float3 shift = to_array(&view, (float3)(lens, 0.0f));
        const Sum value = quadrilinear(
            image, &array, columns, rows, centre + shift, direction - shift * q, q);
        total.red += value.red;
        total.green += value.green;
        total.blue += value.blue;
        total.weight += value.weight;
    }
    const float scale = total.weight > 0.0f ? 1.0f / total.weight : 0.0f;
    out[pixel] = (float4)(
        total.red * scale, total.green * scale, total.blue * scale, total.weight / count);
}
