// Colours of a block's rays, row by row, from what they meet and which lights that sees.
#ifndef LFCORE_SHADE_CL
#define LFCORE_SHADE_CL
#include "lights.cl"

// Shading keys of a block whose texels fit a tile each.
#define TILES 4
typedef struct {
    int key[TILES], count;
    TexelTile tile[TILES];
} TexelTiles;

// Blocks of more regions read their textures ray by ray: tiles would not pay.
#define TILED_REGIONS 8

// The range of texture coordinates over a region of a block of one element.
inline float4 coordinate_range(global const PlaneEquations *p, Rectangle at)
{
    const float2 u = quotient_range(slot_form(p, COORDINATES), p->weights, at);
    const float2 v = quotient_range(slot_form(p, COORDINATES + 1), p->weights, at);
    return (float4)(u.x, v.x, u.y, v.y);
}

// Read the texels of a block of few regions, once for each shading key.
inline void make_tiles(const Scene *scene, const Block *b, TexelTiles *tiles)
{
    tiles->count = 0;
    if (!TEXTURED || OUTER > 1 || b->regions.count > TILED_REGIONS) return;
    float4 range[TILES];
    for (int k = 0; k < b->regions.count; ++k) {
        global const PlaneEquations *p = b->planes + k;
        const Rectangle at = region_rectangle(b->regions.of + k);
        int slot = 0;
        while (slot < tiles->count && tiles->key[slot] != p->key) ++slot;
        if (slot == TILES) continue;
        float4 r = coordinate_range(p, at);
        if (!is_one_sided(p->denominator, at)) r = (float4)(-FAR, -FAR, FAR, FAR);
        if (slot == tiles->count) {
            tiles->key[tiles->count++] = p->key;
            range[slot] = r;
        }
        range[slot].lo = min(range[slot].lo, r.lo);
        range[slot].hi = max(range[slot].hi, r.hi);
    }
    for (int k = 0; k < tiles->count; ++k) {
        const Material m = read_material(scene, tiles->key[k]);
        tiles->tile[k].columns = 0;
        if (m.image.z) make_tile(scene->texels, m.image, range[k], tiles->tile + k);
    }
}

// Colours of the texture of a row of rays.
inline Colour texture_row(const Scene *scene, const TexelTiles *tiles, int key, const Material *m,
                          const Samples *samples, int at)
{
    const vf u = VLOAD(samples->uv + at), v = VLOAD(samples->uv + BLOCK_RAYS + at);
    for (int k = 0; k < tiles->count; ++k)
        if (tiles->key[k] == key && tiles->tile[k].columns)
            return sample_tile(tiles->tile + k, u, v);
    return sample_texture(scene->texels, m->image, u, v);
}

// The material's own colour, times that of texture and corners.
inline Colour albedo_row(const Scene *scene, const TexelTiles *tiles, int key, const Material *m,
                         const Samples *samples, int at)
{
    Colour c = {m->diffuse.x, m->diffuse.y, m->diffuse.z};
    if (TEXTURED && m->image.z) {
        const Colour t = texture_row(scene, tiles, key, m, samples, at);
        c.r *= t.r;
        c.g *= t.g;
        c.b *= t.b;
    }
    if (VERTEX_COLOURS) {
        const Vec tint = load3(samples->tint, at);
        c.r *= tint.x;
        c.g *= tint.y;
        c.b *= tint.z;
    }
    return c;
}

// Light of a row of rays of one material: that of lights without shadows, then of those with.
inline Colour light_row(const Scene *scene, const Block *b, const Surface *s, int at)
{
    const SceneArguments *n = scene->numbers;
    Colour sum = own_light(scene, s);
    for (int k = 0; k < n->open_lights; ++k)
        add_light(scene->lights + k * LIGHT, s, (vi)(-1), &sum);
    for (int k = 0; SHADOWS && k < n->shadow_lights; ++k) {
        const int lit = b->lit[k * BLOCK + at / BLOCK] >> at % BLOCK;
        if (lit & ((1 << LANES) - 1))
            add_light(scene->lights + (n->open_lights + k) * LIGHT, s, mask_of_bits(lit), &sum);
    }
    return sum;
}

inline Colour background_row(const Scene *scene)
{
    const float3 c = vload3(0, scene->numbers->background);
    const Colour colour = {c.x, c.y, c.z};
    return colour;
}

inline void store_colour(Colour c, global float *to, int at)
{
    const Vec v = {c.r, c.g, c.b};
    store3(v, to, at);
}

// A block of which no ray meets anything.
inline void shade_background(const Scene *scene, global float *colours)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES) store_colour(background_row(scene), colours, at);
}

// Directions of unit length to the viewer.
inline Vec viewer_row(const Bundle *r, Row row)
{
    const Vec d = direction_row(r, row);
    return scale3(d, -inverse_sqrt(dot3(d, d)));
}

// Linear colours, not clamped, of a sampled block: (3, BLOCK_RAYS).  A row is shaded material by
// material.
inline void shade_block(const Scene *scene, const Block *b, global float *colours)
{
    TexelTiles tiles;
    make_tiles(scene, b, &tiles);
    int read = -1;
    Material material;
    Surface s;
    s.material = &material;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi keys = VLOAD(b->samples.key + at);
        Colour colour = background_row(scene);
        uint left = row_bits(GE(keys, (vi)(0)));
        if (left) {
            s.point = load3(b->samples.point, at);
            s.normal = load3(b->samples.normal, at);
        }
        while (left) {
            const int key = b->samples.key[at + lowest(left)];
            const vi mine = EQ(keys, (vi)(key));
            left &= ~row_bits(mine);
            if (key != read) material = read_material(scene, key);
            read = key;
            if (PHYSICAL || is_glossy(&material)) s.view = viewer_row(&b->rays, row_at(at));
            s.albedo = albedo_row(scene, &tiles, key, &material, &b->samples, at);
            if (PHYSICAL) read_row_maps(scene, &b->samples, at, &s);
            colour = pick_colour(colour, light_row(scene, b, &s, at), mine);
        }
        store_colour(colour, colours, at);
    }
}

#endif
