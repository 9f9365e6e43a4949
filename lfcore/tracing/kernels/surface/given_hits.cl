// The hits of rays that are given one by one: triangles and weights, from whatever found them.
#pragma once
#include "hits.cl"

// Given rays and their hits; `footprint` may be 0.
typedef struct {
    global const float *origin, *direction;  // (R, 3)
    global RayHit *hits;                     // (R,)
    global const float *footprint;           // (R,) width of a texture filter across the ray
} GivenRays;

// A row of given rays and their hits; triangles of misses are any, their numbers 0.
typedef struct {
    Vec origin, direction, weights;
    vf distance, footprint;
    vi missed;
    TriangleRow triangles;
    Vec normal;  // twice the triangle's area long
    vi front;    // mask of triangles seen from the front
} GivenRow;

// Order the rays [first, end) by material, misses last, so that rows have few materials: numbers of
// rays, BLOCK_RAYS, those from `end` on last of all.
#define BINS 32  // that materials share
inline void order_rays(const Scene *s, const GivenRays *rays, int first, int end, global int *order)
{
    private int next[BINS + 1] = {0};
    private uchar bin[BLOCK_RAYS];
    for (int k = 0; k < BLOCK_RAYS; ++k) {
        const int id = first + k < end ? rays->hits[first + k].triangle : -1;
        bin[k] = id < 0 ? BINS : s->material_ids[id] % BINS;
        ++next[bin[k]];
    }
    for (int k = 0, sum = 0; k <= BINS; ++k) {
        const int count = next[k];
        next[k] = sum;
        sum += count;
    }
    for (int k = 0; k < BLOCK_RAYS; ++k) order[next[bin[k]]++] = first + k;
}

// Read the row of the rays `order`, of which those from `end` on miss; false if all miss.
inline int read_given(const Scene *s, const GivenRays *rays, float pixel_pitch,
                      global const int *order, int end, GivenRow *row)
{
    private float distance[LANES], footprint[LANES];
    private int missed[LANES];
    int any = -1;
    for (int k = 0; k < LANES; ++k) {
        const int ray = min(order[k], end - 1);
        global const RayHit *hit = rays->hits + ray;
        const int id = hit->triangle;
        missed[k] = -(order[k] >= end || id < 0);
        row->triangles.ids[k] = id;
        if (!missed[k]) any = id;
        distance[k] = missed[k] ? 0.0f : hit->distance;
        footprint[k] = rays->footprint && !missed[k] ? rays->footprint[ray] : 0.0f;
        set_ray_vector(&row->origin, k, vload3(ray, rays->origin));
        set_ray_vector(&row->direction, k, vload3(ray, rays->direction));
        set_ray_vector(&row->weights, k, missed[k] ? 0.0f : vload3(0, hit->weights));
    }
    row->distance = VLOAD(distance);
    row->footprint = VLOAD(footprint);
    row->missed = VLOAD(missed);
    if (any < 0) return 0;
    if (!rays->footprint)
        row->footprint = row->distance * pixel_pitch * sqrt(dot3(row->direction, row->direction));
    row->triangles.count = LANES;
    for (int k = 0; k < LANES; ++k)
        if (missed[k]) row->triangles.ids[k] = any;
    Vec v[3];
    read_corners(s, &row->triangles, v);
    row->normal = geometric_normals(v);
    row->front = LT(dot3(row->normal, row->direction), (vf)(0.0f));
    return 1;
}

// Attributes between the corners' by the weights; of flat triangles, the normal.
inline void interpolate_given(const Scene *s, const GivenRow *row, HitRow *out)
{
    const Vec w = row->weights;
    vf at[3], first[3];
    if (!SMOOTH)
        *vectors_at(out, NORMAL) =
            turn_vectors(directions_of(row->normal), ~row->front & (vi)(0x80000000));
    read_first(s, &row->triangles, first);
    for (int slot = FIRST_ATTRIBUTE; slot < WEIGHT; ++slot) {
        read_slot(s, &row->triangles, slot, at);
        const vf sum = fma(w.y, at[1], w.z * at[2]);
        out->value[slot] = slot < TINT ? fma(w.x, at[0], sum) : first[slot - TINT] + sum;
    }
}

// Find where light is baked, on the side of the viewer.
inline void find_grids(const Scene *s, const GivenRow *row, HitRow *out)
{
    private int first[LANES], side[LANES], front[LANES];
    VSTORE(row->front, front);
    for (int k = 0; k < LANES; ++k) {
        global const int *grid = s->grids + 3 * (long)row->triangles.ids[k];
        first[k] = grid[front[k] ? 0 : 1];
        side[k] = grid[2];
    }
    out->first = VLOAD(first);
    out->side = VLOAD(side);
    out->value[WEIGHT] = row->weights.y * TO_VF(out->side);
    out->value[WEIGHT + 1] = row->weights.z * TO_VF(out->side);
}

// Find shading keys and, for PHYSICAL, tangents.
inline void find_keys(const Scene *s, const GivenRow *row, HitRow *out)
{
    const Vec d = row->direction;
    const vf slant = 2.0f * dot3(row->normal, d) * inverse_sqrt(max(dot3(d, d), (vf)(LEAST_LENGTH)));
    private float slants[LANES], footprint[LANES], handedness[LANES];
    private int key[LANES];
    VSTORE(slant, slants);
    VSTORE(row->footprint, footprint);
    for (int k = 0; k < LANES; ++k) {
        const int id = row->triangles.ids[k];
        key[k] = s->material_ids[id] * MIP_LEVELS;
        if (TEXTURED) key[k] += mip_level(s, id, slants[k], footprint[k]);
        if (!PHYSICAL) continue;
        const float3 p = corner(s, id, 0), n = ray_vector(&row->normal, k);
        const int front = slants[k] < 0.0f;
        const float4 t =
            find_tangent(s, id, corner(s, id, 1) - p, corner(s, id, 2) - p, front ? n : -n);
        // Smooth triangles turn to the viewer later, with their normals.
        set_ray_vector(vectors_at(out, TANGENT), k, SMOOTH || front ? t.xyz : -t.xyz);
        handedness[k] = t.w;
    }
    if (PHYSICAL) out->value[TANGENT + 3] = VLOAD(handedness);
    out->key = pick_int(VLOAD(key), (vi)(-1), row->missed);
}

// The hits of given rays [first, end), at most BLOCK_RAYS, in the order that `order` receives.
inline void find_given_hits(const Scene *s, const GivenRays *rays, float pixel_pitch, int first,
                            int end, global int *order, global Hits *out)
{
    order_rays(s, rays, first, end, order);
    out->key_count = 0;
    HitRow hit = {0};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        GivenRow row;
        hit.key = hit.triangle = -1;
        const int any = read_given(s, rays, pixel_pitch, order + at, end, &row);
        store3(row.direction, out->direction, at);
        if (any) {
            find_keys(s, &row, &hit);
            hit.triangle = pick_int(VLOAD(row.triangles.ids), (vi)(-1), row.missed);
        }
        VSTORE(hit.key, out->key + at);
        VSTORE(hit.triangle, out->triangle + at);
        if (!any) continue;
        interpolate_given(s, &row, &hit);
        if (SMOOTH) turn_to_viewer(row.direction, &hit);
        if (BAKED) find_grids(s, &row, &hit);
        if (BAKED) look_up_light(s, &hit);
        write_hits(&hit, fma3(row.distance, row.direction, row.origin), at, out);
        for (int k = 0; k < LANES; ++k)
            if (out->key[at + k] >= 0) add_key(out->key[at + k], out);
    }
}
