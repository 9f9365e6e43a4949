// Occluders: triangles as four forms of a hit point, set up once per block and light.
#ifndef LFCORE_OCCLUDERS_CL
#define LFCORE_OCCLUDERS_CL
#include "shaft.cl"

// 16 roundings of the numbers that enter: a hit point is off its plane by a few.  Against the float64 oracle,
// half of this darkens some rays beside a neighbouring triangle, four times it loses contact shadows.
#define SHADOW_MARGIN 1.0e-6f

// Apex and extent of a block's shadow rays.
typedef struct {
    int is_point;
    float3 apex;           // the light, or the middle of the hit points
    float3 towards;        // direction to a directional light
    float3 centre, extent; // box of the hit points relative to the apex
    float3 size;           // largest magnitudes that entered, for the margin
    int2 own;              // the light's own triangles, which never shadow it: first, and after the last
} ShadowRays;

// A form n . P + c of the hit point relative to the apex.
typedef struct { Vec n; vf c; } Plane;

inline vf plane_reach(Plane f, const ShadowRays *r)
{
    const vf middle = fma(f.n.x, (vf)(r->centre.x), fma(f.n.y, (vf)(r->centre.y), fma(f.n.z, (vf)(r->centre.z), f.c)));
    const vf spread = fma(fabs(f.n.x), (vf)(r->extent.x), fma(fabs(f.n.y), (vf)(r->extent.y), fabs(f.n.z) * r->extent.z));
    const vf noise = fma(fabs(f.n.x), (vf)(r->size.x), fma(fabs(f.n.y), (vf)(r->size.y), fma(fabs(f.n.z), (vf)(r->size.z), fabs(f.c))));
    return middle + 1.00001f * spread + 1.0e-6f * noise;
}

inline Plane flip_plane(Plane f, vi sign)
{
    FLIP_BY(f.n.x, sign); FLIP_BY(f.n.y, sign); FLIP_BY(f.n.z, sign); FLIP_BY(f.c, sign);
    return f;
}

// LANES triangles as occluders: corners relative to the apex, and the sign that turns forms to the side that the light is on.
typedef struct { Vec v[3]; vi flip; } Occluders;

inline void place_occluders(const ShadowRays *r, global const float *leaf, Occluders *o)
{
    for (int k = 0; k < 3; ++k) {
        o->v[k].x = VLOAD(leaf + 48 * k) - r->apex.x;
        o->v[k].y = VLOAD(leaf + 48 * k + 16) - r->apex.y;
        o->v[k].z = VLOAD(leaf + 48 * k + 32) - r->apex.z;
    }
}

// Beyond the triangles' own planes this form is positive.  `may` loses those seen edge-on, which cast no shadow.
inline Plane face_occluders(const ShadowRays *r, Occluders *o, vi *may)
{
    const Vec *v = o->v;
    const Vec a = {v[1].x - v[0].x, v[1].y - v[0].y, v[1].z - v[0].z}, b = {v[2].x - v[0].x, v[2].y - v[0].y, v[2].z - v[0].z};
    const Vec n = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    const Vec to = {(vf)(r->towards.x), (vf)(r->towards.y), (vf)(r->towards.z)};
    const vf offset = dot3(n, v[0]);
    const vf side = r->is_point ? offset : dot3(n, to);
    o->flip = AS_VI(side) & (vi)(0x80000000);
    *may &= ~EQ(side, (vf)(0.0f));
    const vf margin = SHADOW_MARGIN * fma(fabs(n.x), fabs(v[0].x) + r->size.x,
                                    fma(fabs(n.y), fabs(v[0].y) + r->size.y, fabs(n.z) * (fabs(v[0].z) + r->size.z)));
    const Plane plane = {n, -offset};
    Plane beyond = flip_plane(plane, r->is_point ? o->flip : o->flip ^ (vi)(0x80000000));
    beyond.c -= margin;
    return beyond;
}

// Within all three edges these forms are not negative.
inline Plane edge_of_occluders(const ShadowRays *r, const Occluders *o, int k)
{
    const Vec q = o->v[(k + 1) % 3], w = o->v[(k + 2) % 3];
    const Vec c = {q.y * w.z - q.z * w.y, q.z * w.x - q.x * w.z, q.x * w.y - q.y * w.x};
    Plane edge = {c, 0.0f};
    if (!r->is_point) {
        const Vec to = {(vf)(r->towards.x), (vf)(r->towards.y), (vf)(r->towards.z)};
        const Vec d = {w.x - q.x, w.y - q.y, w.z - q.z};
        const Vec along = {to.y * d.z - to.z * d.y, to.z * d.x - to.x * d.z, to.x * d.y - to.y * d.x};
        edge.n = along;
        edge.c = dot3(to, c);
    }
    return flip_plane(edge, o->flip);
}

// The four forms of LANES triangles: a ray is dark where the three edges are not negative and the
// last, beyond the triangle's plane, is positive.  Returns the mask of those that may darken the block.
inline vi setup_occluders(const ShadowRays *r, const Shaft *shaft, global const float *leaf, Plane *out)
{
    vi keep = ~shaft_misses(shaft, leaf);
    if (!row_any(keep)) return keep;
    Occluders o;
    place_occluders(r, leaf, &o);
    out[3] = face_occluders(r, &o, &keep);
    keep &= GE(plane_reach(out[3], r), (vf)(0.0f));
    if (!row_any(keep)) return keep;
    for (int k = 0; k < 3; ++k) {
        out[k] = edge_of_occluders(r, &o, k);
        keep &= GE(plane_reach(out[k], r), (vf)(0.0f));
    }
    return keep;
}

// Which of LANES triangles are a light's own.
inline vi are_own(int2 own, global const int *ids)
{
#if EMITTERS
    return GE(VLOAD(ids), (vi)(own.x)) & LT(VLOAD(ids), (vi)(own.y));
#else
    return 0;
#endif
}

// Look at the hit points between lo and hi alone; what they are relative to, and so every occluder, stays.
inline void aim_at(ShadowRays *r, const float *lo, const float *hi)
{
    r->centre = 0.5f * (vload3(0, lo) + vload3(0, hi)) - r->apex;
    r->extent = 0.5f * (vload3(0, hi) - vload3(0, lo));
}

// The triangles of the emitter that a light is a point of: the first, and that after the last.
inline int2 own_triangles(global const float *light)
{
#if EMITTERS
    return as_int2(vload2(0, light + LIGHT_OWN));
#else
    return 0;
#endif
}

inline ShadowRays shadow_rays(global const float *light, const float *lo, const float *hi)
{
    ShadowRays r;
    const float3 low = vload3(0, lo), high = vload3(0, hi), l = vload3(0, light);
    r.is_point = IS_POINT(light);
    r.apex = r.is_point ? l : 0.5f * (low + high);
    r.towards = l;
    r.own = own_triangles(light);
    aim_at(&r, lo, hi);
    r.size = max(fabs(low), fabs(high)) + fabs(r.centre) + r.extent;
    return r;
}

#endif
