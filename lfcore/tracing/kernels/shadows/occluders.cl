// Occluders: triangles as four affine functions of a hit point, set up LANES at a time.
//
// All shadow rays of a set share the light as apex (or a direction).  A point is in shadow if it is
// within the triangle's three edge planes, which contain the light, and beyond the triangle's
// plane.  Affine functions and hit points are relative to the apex.
#pragma once
#include "shadow_rays.cl"
#include "triangles.cl"

// An affine function n . P + c of the hit point relative to the apex.
typedef struct { Vec n; vf c; } HalfSpace;

inline HalfSpace flip_half_space(HalfSpace f, vi sign)
{
    return (HalfSpace){turn_vectors(f.n, sign), flip_sign(f.c, sign)};
}

// SHADOW_MARGIN of n . P, of the corner v and points P of magnitude `size`.
inline vf shadow_margin(Vec n, Vec v, float3 size)
{
    return SHADOW_MARGIN * dot3(absolute3(n), plus3(absolute3(v), spread3(size)));
}

// LANES triangles: corners relative to the apex, and the sign that turns affine functions to the
// side of the light.
typedef struct { Vec v[3]; vi flip; } Occluders;

// This function is positive beyond the triangle's plane.  `may` loses triangles that are edge-on to
// the light, which cast no shadow.
inline HalfSpace face_plane(const ShadowRays *r, Occluders *o, vi *may)
{
    const Vec n = geometric_normals(o->v);
    const vf offset = dot3(n, o->v[0]);
    const vf side = r->is_point ? offset : dot3(n, spread3(r->towards));
    o->flip = AS_VI(side) & (vi)(0x80000000);
    *may &= ~EQ(side, (vf)(0.0f));
    const HalfSpace plane = {n, -offset};
    HalfSpace beyond = flip_half_space(plane, r->is_point ? o->flip : o->flip ^ (vi)(0x80000000));
    beyond.c -= shadow_margin(n, o->v[0], r->size);
    return beyond;
}

// This function is not negative within edge `k`.
inline HalfSpace edge_plane(const ShadowRays *r, const Occluders *o, int k)
{
    const Vec q = o->v[(k + 1) % 3], w = o->v[(k + 2) % 3], along = minus3(w, q);
    const Vec c = edge_normals(q, w);
    HalfSpace edge = {c, 0.0f};
    if (!r->is_point) {
        const Vec to = spread3(r->towards);
        edge.n = cross3(to, plus3(along, along));
        edge.c = dot3(to, c);
    }
    return flip_half_space(edge, o->flip);
}
