// The hits of rays: all that shading, baked light, textures, highlights and skies read, whether the
// rays are a block's (block_hits.cl) or given one by one (given_hits.cl).
#pragma once
#include "baked.cl"
#include "blocks.cl"

// The quantities of a hit: the slots, with baked light in place of WEIGHT, and the tangent with its
// sign.
enum { BAKED_LIGHT = WEIGHT, TANGENT = SLOTS + BAKED, QUANTITIES = TANGENT + 4 * PHYSICAL };

typedef struct {
    float direction[3 * BLOCK_RAYS];  // of the rays, of any length
    float point[3 * BLOCK_RAYS];      // where they hit surfaces
    float value[QUANTITIES][BLOCK_RAYS];
    int key[BLOCK_RAYS];              // shading key: material * MIP_LEVELS + level; -1 for a miss
    int triangle[BLOCK_RAYS];         // -1 for a miss
    int keys[BLOCK_RAYS], key_count;  // the distinct shading keys
} Hits;

// A row of hits on its way to the record.
typedef struct {
    vf depth, value[QUANTITIES];
    vi key, triangle;
    vi first, side;  // of the grid of baked light
} HitRow;

// Three quantities, from `first` on.
inline Vec *vectors_at(HitRow *s, int first) { return (Vec *)(s->value + first); }

// Look up a row's baked light, which replaces the weights that locate it on grids.
inline void look_up_light(const Scene *s, HitRow *row)
{
    const vf *at = row->value + WEIGHT;
    *vectors_at(row, BAKED_LIGHT) = baked_row(s, at[0], at[1], row->first, row->side);
}

// Normalise interpolated normals, and turn normals and tangents to the viewer.
inline void turn_to_viewer(Vec direction, HitRow *s)
{
    Vec *n = vectors_at(s, NORMAL), *tangent = vectors_at(s, TANGENT);
    *n = scale3(*n, inverse_sqrt(max(dot3(*n, *n), (vf)(LEAST_LENGTH))));
    const vi away = GT(dot3(*n, direction), (vf)(0.0f)) & (vi)(0x80000000);
    *n = turn_vectors(*n, away);
    if (PHYSICAL) *tangent = turn_vectors(*tangent, away);
}

// Write the row that begins with ray `at`.
inline void write_hits(const HitRow *row, Vec point, int at, global Hits *out)
{
    store3(point, out->point, at);
    for (int k = 0; k < QUANTITIES; ++k) VSTORE(row->value[k], out->value[k] + at);
}

// Add to the record's distinct shading keys.
inline void add_key(int key, global Hits *out)
{
    for (int k = 0; k < out->key_count; ++k)
        if (out->keys[k] == key) return;
    out->keys[out->key_count++] = key;
}
