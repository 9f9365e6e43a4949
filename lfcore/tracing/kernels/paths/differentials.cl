// Ray differentials: how a point on a path and its unit direction move with the lens point (s, t)
// and with the pixel (x, y), in that order.
//
// Source: H. Igehy, "Tracing ray differentials", SIGGRAPH 1999.
#pragma once
#include "hits.cl"

#define MOVES 4
typedef struct { Vec point[MOVES], turn[MOVES]; } Differentials;

// Move to `distance` along `direction`, onto planes with normals `plane`.
inline void move_on(Differentials *d, vf distance, Vec direction, Vec plane)
{
    const vf slant = dot3(direction, plane);
    for (int k = 0; k < MOVES; ++k) {
        const Vec shifted = fma3(distance, d->turn[k], d->point[k]);
        d->point[k] = fma3(-dot3(shifted, plane) / slant, direction, shifted);
    }
}

// Reflect; `bends` are the differentials of the unit normal n.
inline void mirror_moves(Differentials *d, Vec direction, Vec n, const Vec *bends)
{
    const vf cosine = dot3(direction, n);
    for (int k = 0; k < MOVES; ++k) {
        const vf change = dot3(d->turn[k], n) + dot3(direction, bends[k]);
        const Vec off = fma3(cosine, bends[k], scale3(n, change));
        d->turn[k] = fma3((vf)(-2.0f), off, d->turn[k]);
    }
}

// Refract: `eta` is the index in front over that behind, n is in front.
inline void refract_moves(Differentials *d, Vec direction, Vec n, const Vec *bends, vf eta)
{
    const vf cosine = dot3(direction, n), square = 1.0f - eta * eta * (1.0f - cosine * cosine);
    const vf behind = -sqrt(max(square, (vf)(NOTHING_LEFT)));
    const vf factor = eta * cosine - behind, slope = eta - eta * eta * cosine / behind;
    const vi straight = EQ(eta, (vf)(1.0f));
    for (int k = 0; k < MOVES; ++k) {
        const vf change = slope * (dot3(d->turn[k], n) + dot3(direction, bends[k]));
        const Vec off = fma3(factor, bends[k], scale3(n, change));
        d->turn[k] = pick3(minus3(scale3(d->turn[k], eta), off), d->turn[k], straight);
    }
}

// The differentials of the interpolated unit normal on the side of `normal`, at barycentric
// weights w of triangles with corners v; normal maps bend no further.
inline void find_bends(const Scene *s, const TriangleRow *triangles, const Vec *v, Vec w,
                       Vec normal, const Differentials *d, Vec *bends)
{
    for (int k = 0; k < MOVES; ++k) bends[k] = spread3(0.0f);
    if (!SMOOTH) return;
    Vec normals[3];
    for (int axis = 0; axis < 3; ++axis) {
        vf at[3];
        read_slot(s, triangles, NORMAL + axis, at);
        for (int k = 0; k < 3; ++k)
            *(axis == 0 ? &normals[k].x : axis == 1 ? &normals[k].y : &normals[k].z) = at[k];
    }
    const Vec mean = fma3(w.x, normals[0], fma3(w.y, normals[1], scale3(normals[2], w.z)));
    const vf square = max(dot3(mean, mean), (vf)(LEAST_LENGTH)), inverse = inverse_sqrt(square);
    const Vec b = minus3(v[1], v[0]), c = minus3(v[2], v[0]), n = cross3(b, c);
    const vf area = max(dot3(n, n), (vf)(LEAST_LENGTH));
    const Vec along_b = scale3(cross3(c, n), 1.0f / area), along_c = scale3(cross3(n, b), 1.0f / area);
    const Vec normals_b = minus3(normals[1], normals[0]), normals_c = minus3(normals[2], normals[0]);
    const vi side = sign_of(dot3(mean, normal));
    for (int k = 0; k < MOVES; ++k) {
        const Vec change = fma3(dot3(d->point[k], along_b), normals_b,
                                scale3(normals_c, dot3(d->point[k], along_c)));
        const Vec across = fma3(-dot3(change, mean) / square, mean, change);
        bends[k] = turn_vectors(scale3(across, inverse), side);
    }
}

// The inverse depth at which the end of a path in `direction` appears: at its point or, `beyond`
// all surfaces, in its direction.  Where the lens point changes, the pixel that keeps the end in
// place has dx/ds = -(dQ/dx)^-1 dQ/ds, and half the trace of its negative is the inverse depth.
inline vf apparent_depth(const Differentials *d, Vec direction, int beyond)
{
    // Two of three coordinates suffice; the longest of the direction is left out.
    const Vec size = absolute3(direction);
    const vi first = GE(size.x, size.y) & GE(size.x, size.z), last = ~first & GE(size.z, size.y);
    vf a[MOVES], b[MOVES];
    for (int k = 0; k < MOVES; ++k) {
        const Vec end = beyond ? d->turn[k] : d->point[k];
        const Vec across = fma3(-dot3(end, direction), direction, end);
        a[k] = pick(across.x, across.y, first);
        b[k] = pick(across.z, across.y, last);
    }
    const vf cross = a[2] * b[3] - a[3] * b[2];
    const vf trace = (b[3] * a[0] - a[3] * b[0]) + (a[2] * b[1] - b[2] * a[1]);
    return 0.5f * trace / cross;
}
