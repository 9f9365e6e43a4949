// Gather rays of points, and the light that they bring: see lfcore/baking/gather.py.

#include "kernel.cl"

#define KERNEL KERNEL_OF(float4)
#define CELL_LIMITS (GUIDE_SIDE + 1)

inline float inner_product(float3 a, float3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

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

// Make rays of points: starts, unit directions whose density is proportional to the cosine times
// that of the point's table, and what weighs them.
KERNEL void aim(aim_PARAMETERS)
{
    for (int p = get_global_id(0); p < numbers.points; p += get_global_size(0)) {
        const Point at = points[p];
        const float3 n = vload3(0, at.normal), flat = vload3(0, at.flat);
        const float3 place = vload3(0, at.place);
        // The frame of T. Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
        const float sign = copysign(1.0f, n.z), u = -1.0f / (sign + n.z), v = n.x * n.y * u;
        const float3 across = (float3)(1.0f + sign * n.x * n.x * u, sign * v, -sign * n.x);
        const float3 down = (float3)(v, sign + n.y * n.y * u, -n.y);
        for (int k = 0; k < numbers.count; ++k) {
            const ulong ray = (ulong)p * numbers.count + k;
            float a = to_unit((numbers.first + k) * R2_A + at.shift[0]);
            float b = to_unit((numbers.first + k) * R2_B + at.shift[1]);
            sent[ray].weight = 1.0f;
            if (at.table >= 0) {
                const int row = at.table * GUIDE_SIDE + find_cell(rows + at.table * CELL_LIMITS, &a);
                const int column = find_cell(columns + row * CELL_LIMITS, &b);
                sent[ray].weight = cell_weights[row * GUIDE_SIDE + column];
                a = (row % GUIDE_SIDE + a) / GUIDE_SIDE;
                b = (column + b) / GUIDE_SIDE;
            }
            const float2 turn = sqrt(a) * circle[(int)(b * TURNS)];
            const float3 d = turn.x * across + turn.y * down + sqrt(1.0f - a) * n;
            sent[ray].cosine = fmax(inner_product(n, d), 0.0f);
            // Off the triangle, on the side to which the ray goes.
            const float along = inner_product(flat, d);
            vstore3(place + (along < -ALONG_SURFACE ? -at.lift : at.lift) * flat, ray, origins);
            vstore3(d, ray, directions);
        }
    }
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

// Sum light over each half of a point's rays.
inline void add_to_half(int k, int count, float3 light, float3 *sum, global PointSum *out)
{
    *sum += light;
    if (k + 1 != count / 2 && k + 1 != count) return;
    vstore3(*sum, k + 1 == count, out->halves);
    *sum = 0.0f;
}

// Sum the light that surfaces reflect along rays, and find all light of each ray.
KERNEL void reflect(reflect_PARAMETERS)
{
    for (int p = get_global_id(0); p < numbers.points; p += get_global_size(0)) {
        float3 sum = 0.0f;
        for (int k = 0; k < numbers.count; ++k) {
            const ulong ray = (ulong)p * numbers.count + k;
            global const KeptHit *hit = kept + ray;
            float3 reflected = 0.0f;
            if (hit->face >= 0) {
                const float3 w = vload_half3(0, (global const half *)hit->weights);
                const int at = index[nearest_of(faces + hit->face, w)];
                reflected = vload_half3(0, (global const half *)hit->albedo) * vload3(at, light);
            }
            ray_light[ray] = vload_half(0, (global const half *)&hit->emission) +
                             (reflected.x + reflected.y + reflected.z) / 3.0f;
            add_to_half(k, numbers.count, reflected, &sum, sums + p);
        }
    }
}

// Sum the light of rays; find whether a ray of a point left the scene or hit a seen face; and keep
// the hits.  Surfaces reflect nothing while `light` is 0.
KERNEL void sum_light(sum_light_PARAMETERS)
{
    for (int p = get_global_id(0); p < numbers.points; p += get_global_size(0)) {
        float3 sum = 0.0f;
        sums[p].is_open = 0;
        for (int k = 0; k < numbers.count; ++k) {
            const ulong ray = (ulong)p * numbers.count + k;
            const RayHit found = hits[ray];
            const int id = found.triangle;
            float3 emitted = vload3(ray, emission), reflected = 0.0f, share = 0.0f, w = 0.0f;
            float density = 0.0f;
            global KeptHit *hit = kept + ray;
            hit->face = -1;
            if (id < 0) {
                sums[p].is_open = 1;
            } else {
                const float slant = inner_product(vload3(id, flats), vload3(ray, directions));
                hit->face = 2 * id + (slant > 0.0f);
                global const Face *face = faces + hit->face;
                sums[p].is_open |= face->is_seen;
                density = face->density * found.distance * found.distance / fmax(fabs(slant), 1e-9f);
                if (!face->emits) emitted = 0.0f;
                w = vload3(0, found.weights);
                share = fmin(vload3(ray, albedo), 1.0f);
                if (light) reflected = share * vload3(index[nearest_of(face, w)], light);
            }
            const float cosine = sent[ray].cosine;
            emitted *= cosine / fmax(cosine + numbers.emitter_share * density, 1e-30f);
            vstore_half3(w, 0, (global half *)hit->weights);
            vstore_half3(share, 0, (global half *)hit->albedo);
            vstore_half((emitted.x + emitted.y + emitted.z) / 3.0f, 0, (global half *)&hit->emission);
            add_to_half(k, numbers.count, sent[ray].weight * (emitted + reflected), &sum, sums + p);
        }
    }
}
