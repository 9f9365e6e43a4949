// Offsets of shadow rays' origins.
//
// Smooth normals describe a curved surface, but the triangles are a polyhedron, which casts jagged
// shadows on itself at grazing light.  On curved materials the origin is therefore offset outwards,
// towards the tangent planes at the triangle's corners, by the corners' weights.
//
// Source: J. Hanika, "Hacking the Shadow Terminator", Ray Tracing Gems II, chapter 4, 2021.
#pragma once
#include "hits.cl"

// A triangle with the gradients of its barycentric weights; the first corner's is not used.
typedef struct { float3 corner[3], normal[3], gradient[3]; } CurvedTriangle;

// False for a flat triangle: its material is not curved, or its normals are equal.
inline int read_curved(const Scene *s, int triangle, CurvedTriangle *c)
{
    if (!s->materials[s->material_ids[triangle]].curved) return 0;
    for (int k = 0; k < 3; ++k) {
        c->corner[k] = corner(s, triangle, k);
        c->normal[k] = vload3(k, attributes_of(s, triangle));
    }
    if (max(largest_component(c->normal[1] - c->normal[0]),
            largest_component(c->normal[2] - c->normal[0])) < FLAT_NORMALS) return 0;
    // In units of the triangle's size, so that no square underflows.
    float3 a = c->corner[1] - c->corner[0], b = c->corner[2] - c->corner[0];
    const float unit = 1.0f / max(largest_component(a), largest_component(b));
    a *= unit;
    b *= unit;
    const float3 n = cross_product(a, b);
    const float share = unit / max(inner_product(n, n), LEAST_LENGTH);
    c->gradient[1] = share * cross_product(b, n);
    c->gradient[2] = share * cross_product(n, a);
    return 1;
}

// The origins for a row of hit points, offset to the side of `normal`.
inline Vec offset_row(const CurvedTriangle *c, Vec point, Vec normal)
{
    const vi side = sign_of(dot3(normal, spread3(c->normal[0] + c->normal[1] + c->normal[2])));
    const Vec from = minus3(point, spread3(c->corner[0]));
    vf weight[3];
    for (int k = 1; k < 3; ++k) weight[k] = max(dot3(from, spread3(c->gradient[k])), (vf)(0.0f));
    weight[0] = max(1.0f - weight[1] - weight[2], (vf)(0.0f));
    Vec offset = point;
    for (int k = 0; k < 3; ++k) {
        const Vec n = turn_vectors(spread3(c->normal[k]), side);
        const vf height = dot3(minus3(point, spread3(c->corner[k])), n);
        offset = fma3(-weight[k] * min(height, (vf)(0.0f)), n, offset);
    }
    return offset;
}

// Write the origins of shadow rays to `origins`; false if they are the hit points.
inline int offset_origins(const Scene *scene, global const Hits *hits, global float *origins)
{
    CurvedTriangle c;
    int last = -1, is_curved = 0, any_curved = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi triangle = VLOAD(hits->triangle + at);
        const Vec point = load3(hits->point, at);
        Vec origin = point;
        for (uint left = row_bits(GE(triangle, (vi)(0))); left;) {
            const int id = hits->triangle[at + lowest(left)];
            const vi mine = EQ(triangle, (vi)(id));
            left &= ~row_bits(mine);
            if (id != last) is_curved = read_curved(scene, last = id, &c);
            if (!is_curved) continue;
            any_curved = 1;
            origin = pick3(origin, offset_row(&c, point, load3(hits->value[NORMAL], at)), mine);
        }
        store3(origin, origins, at);
    }
    return any_curved;
}
