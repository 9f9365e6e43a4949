// Gather rays of points, and the light that they bring: see lfcore/baking/gather.py.

#include "kernel.cl"

#define KERNEL KERNEL_OF(float4)
#define CELL_LIMITS (GUIDE_SIDE + 1)

// A sample in ]0, 1[ of 32 bits.
inline float to_unit(uint bits) { return fmin(((bits >> 8) + 0.5f) / 16777216.0f, 1.0f - 0x1p-24f); }

// Find the cell that contains x, from the limits of cells; x becomes its place in the cell, below 1.
inline int find_cell(global const float *limits, float *x)
{
    int at = 0;
    for (int step = GUIDE_SIDE / 2; step; step /= 2)
        if (limits[at + step] <= *x) at += step;
    *x = fmin((*x - limits[at]) / (limits[at + 1] - limits[at]), 1.0f - 0x1p-20f);
    return at;
}

// Make `count` rays per point, from number `first` on: starts, unit directions whose density is
// proportional to the cosine times that of the point's table, and the rays' weights.
KERNEL void aim(const int number, const int count, global const Point *restrict points,
                const uint first, global const float *restrict rows,
                global const float *restrict columns, global const float *restrict cell_weights,
                global const float2 *restrict circle, global float *restrict origins,
                global float *restrict directions, global float *restrict ray_weight)
{
    for (int p = get_global_id(0); p < number; p += get_global_size(0)) {
        const Point at = points[p];
        const float3 n = vload3(0, at.normal), flat = vload3(0, at.flat);
        const float3 place = vload3(0, at.place);
        // The frame of T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
        const float sign = copysign(1.0f, n.z), u = -1.0f / (sign + n.z), v = n.x * n.y * u;
        const float3 across = (float3)(1.0f + sign * n.x * n.x * u, sign * v, -sign * n.x);
        const float3 down = (float3)(v, sign + n.y * n.y * u, -n.y);
        for (int k = 0; k < count; ++k) {
            const ulong ray = (ulong)p * count + k;
            float a = to_unit((first + k) * R2_A + at.shift[0]);
            float b = to_unit((first + k) * R2_B + at.shift[1]);
            ray_weight[ray] = 1.0f;
            if (at.table >= 0) {
                const int row = at.table * GUIDE_SIDE + find_cell(rows + at.table * CELL_LIMITS, &a);
                const int column = find_cell(columns + row * CELL_LIMITS, &b);
                ray_weight[ray] = cell_weights[row * GUIDE_SIDE + column];
                a = (row % GUIDE_SIDE + a) / GUIDE_SIDE;
                b = (column + b) / GUIDE_SIDE;
            }
            const float2 turn = sqrt(a) * circle[(int)(b * TURNS)];
            const float3 d = turn.x * across + turn.y * down + sqrt(1.0f - a) * n;
            // Off the triangle, on the side to which the ray goes.
            const float along = flat.x * d.x + flat.y * d.y + flat.z * d.z;
            vstore3(place + (along < -ALONG_SURFACE ? -at.lift : at.lift) * flat, ray, origins);
            vstore3(d, ray, directions);
        }
    }
}

// Look up a sky's octahedral map bilinearly, as scene/sky.py does.
inline float3 sky_along(global const float *sky, int side, float3 d)
{
    d /= fabs(d.x) + fabs(d.y) + fabs(d.z);
    float2 at = d.xy;
    if (d.z < 0.0f) at = copysign(1.0f - fabs(d.yx), d.xy);
    at = clamp((at * 0.5f + 0.5f) * side - 0.5f, 0.0f, side - 1.0f);
    const int2 low = min(convert_int2(at), side - 2);
    const float2 f = at - convert_float2(low);
    const int first = low.y * side + low.x;
    const float3 left = vload3(first, sky), below = vload3(first + side, sky);
    const float3 top = left + f.x * (vload3(first + 1, sky) - left);
    return top + f.y * (below + f.x * (vload3(first + side + 1, sky) - below) - top);
}

// Interpolate the corners' values (3, 3).
inline float3 between3(global const float *of, float3 w)
{
    return w.x * vload3(0, of) + w.y * vload3(1, of) + w.z * vload3(2, of);
}

inline float3 texel_of(global const Texture *t, global const float *texels,
                       global const float *uvs, float3 w)
{
    const float2 uv = w.x * vload2(0, uvs) + w.y * vload2(1, uvs) + w.z * vload2(2, uvs);
    const int2 size = (int2)(t->width, t->height);
    const int2 at = clamp(convert_int2((uv - floor(uv)) * convert_float2(size)), 0, size - 1);
    return vload3(t->first + (size.y - 1 - at.y) * size.x + at.x, texels);
}

// Find the point of a face's grid that is nearest to barycentric weights.
inline int nearest_of(global const Face *face, float3 w)
{
    const int side = face->side;
    int i = convert_int_rte(w.y * side), j = convert_int_rte(w.z * side);
    if (i + j > side && w.y >= w.z) --i;
    i = clamp(i, 0, side);
    j = clamp(j, 0, side - i);
    return face->first + j * (2 * side + 3 - j) / 2 + i;
}

// Sum the light that surfaces reflect along rays, (2, number, 3), per half of a point's rays; and
// find all light of each ray.
KERNEL void reflect(const int number, const int count, global const half *restrict emitted,
                    global const int *restrict hits, global const half *restrict weights,
                    global const half *restrict colours, global const Face *restrict faces,
                    global const int *restrict index, global const float *restrict light,
                    global float *restrict sums, global float *restrict ray_light)
{
    for (int p = get_global_id(0); p < number; p += get_global_size(0)) {
        float3 half_sum = 0.0f;
        for (int k = 0; k < count; ++k) {
            const ulong ray = (ulong)p * count + k;
            float3 sent = 0.0f;
            if (hits[ray] >= 0) {
                const int at = index[nearest_of(faces + hits[ray], vload_half3(ray, weights))];
                sent = vload_half3(ray, colours) * vload3(at, light);
            }
            half_sum += sent;
            ray_light[ray] = vload_half(ray, emitted) + (sent.x + sent.y + sent.z) / 3.0f;
            if (k + 1 != count / 2 && k + 1 != count) continue;
            vstore3(half_sum, (k + 1 == count) * (ulong)number + p, sums);
            half_sum = 0.0f;
        }
    }
}

// Sum the light of rays, (2, number, 3), per half of a point's rays; find whether a ray of a point
// left the scene or hit a seen face; and keep the hits, with the reflectance and the emission there.
// Surfaces reflect nothing while `light` is 0.
KERNEL void shade(const int number, const int count, global const Point *restrict points,
                  global const float *restrict directions, global const float *restrict ray_weight,
                  global const int *restrict triangles, global const float *restrict distances,
                  global const float *restrict weights, global const float *restrict flats,
                  global const Matt *restrict materials,
                  global const int *restrict material_ids, global const float *restrict uvs,
                  global const float *restrict tints, global const Texture *restrict textures,
                  global const float *restrict texels, global const float *restrict sky,
                  const int sky_side, const float emitter_share,
                  global const Face *restrict faces, global const int *restrict index,
                  global const float *restrict light, global float *restrict sums,
                  global uchar *restrict is_open, global half *restrict emitted,
                  global int *restrict hits, global half *restrict hit_weights,
                  global half *restrict colours)
{
    for (int p = get_global_id(0); p < number; p += get_global_size(0)) {
        const float3 n = vload3(0, points[p].normal);
        float3 half_sum = 0.0f;
        is_open[p] = 0;
        for (int k = 0; k < count; ++k) {
            const ulong ray = (ulong)p * count + k;
            const int triangle = triangles[ray];
            const float3 d = vload3(ray, directions);
            float3 emission = 0.0f, colour = 0.0f, reflected = 0.0f, w = 0.0f;
            float density = 0.0f;
            hits[ray] = -1;
            if (triangle < 0) {
                is_open[p] = 1;
                if (sky_side) emission = sky_along(sky, sky_side, d);
            } else {
                const float3 up = vload3(triangle, flats);
                const float slant = up.x * d.x + up.y * d.y + up.z * d.z;
                hits[ray] = 2 * triangle + (slant > 0.0f);
                global const Face *face = faces + hits[ray];
                w = vload3(ray, weights);
                global const Matt *m = materials + material_ids[triangle];
                global const float *uv = uvs + 6 * (ulong)triangle;
                is_open[p] |= face->is_seen;
                density = face->density * distances[ray] * distances[ray] / fmax(fabs(slant), 1e-9f);
                if (face->emits) {
                    emission = vload3(0, m->emission);
                    if (m->emission_texture >= 0)
                        emission *= texel_of(textures + m->emission_texture, texels, uv, w);
                }
                colour = vload3(0, m->diffuse);
                if (m->texture >= 0) colour *= texel_of(textures + m->texture, texels, uv, w);
                if (TINTED) colour *= between3(tints + 9 * (ulong)triangle, w);
                colour = fmin(colour + m->base, 1.0f);
                if (light) reflected = colour * vload3(index[nearest_of(face, w)], light);
            }
            const float cosine = fmax(n.x * d.x + n.y * d.y + n.z * d.z, 0.0f);
            emission *= cosine / fmax(cosine + emitter_share * density, 1e-30f);
            half_sum += ray_weight[ray] * (emission + reflected);
            vstore_half3(w, ray, hit_weights);
            vstore_half3(colour, ray, colours);
            vstore_half((emission.x + emission.y + emission.z) / 3.0f, ray, emitted);
            if (k + 1 != count / 2 && k + 1 != count) continue;
            vstore3(half_sum, (k + 1 == count) * (ulong)number + p, sums);
            half_sum = 0.0f;
        }
    }
}
