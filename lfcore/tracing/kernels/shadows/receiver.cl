// Receiver planes: shadows on the rays of one element that meet one triangle.
//
// A hit point times the denominator of its depth is affine over the rays: rays of a pixel meet in
// its focus point, rays of a view in the lens sample, and either way the map to the plane is a
// homography. So the forms of occluders are affine over the rays, too, and are tested as triangles
// are.
#ifndef LFCORE_RECEIVER_CL
#define LFCORE_RECEIVER_CL
#include "shadow_mask.cl"

// (P - apex) times the weight, and the weight, which is positive over the rectangle: of each the
// terms ONE, X and Y.
typedef struct { float3 place[3]; float weight[3]; } Receiver;

inline Receiver make_receiver(const Bundle *r, global const PlaneEquations *p, float3 apex)
{
    const Form z = p->numerator, w = p->denominator;
    const float3 o = (float3)(r->ox, r->oy, 0.0f), d = (float3)(r->dx, r->dy, 1.0f);
    const float3 sx = (float3)(r->sx, 0.0f, 0.0f), tx = (float3)(r->tx, 0.0f, 0.0f);
    const float3 sy = (float3)(0.0f, r->sy, 0.0f), ty = (float3)(0.0f, r->ty, 0.0f);
    Receiver f;
    f.place[ONE] = o * w.of[ONE] + z.of[ONE] * d;
    f.place[X] = sx * w.of[ONE] + o * w.of[X] + z.of[X] * d + z.of[ONE] * tx;
    f.place[Y] = sy * w.of[ONE] + o * w.of[Y] + z.of[Y] * d + z.of[ONE] * ty;
    for (int k = 0; k < 3; ++k) {
        f.weight[k] = w.of[k];
        f.place[k] -= apex * w.of[k];
    }
    return f;
}

inline Forms project_plane(const Receiver *f, Plane p)
{
    Forms e;
    for (int k = 0; k < 3; ++k) {
        const float3 at = f->place[k];
        const vf last = fma(p.n.z, (vf)(at.z), p.c * f->weight[k]);
        e.of[k] = fma(p.n.x, (vf)(at.x), fma(p.n.y, (vf)(at.y), last));
    }
    return e;
}

// Bounds of what a bundle sees in a rectangle of its rays between two depths.
inline Box bundle_box(const Bundle *r, Rectangle at, float2 depths)
{
    Box box;
    for (int axis = 0; axis < 2; ++axis) {
        const float4 place = axis ? corners_y(at) : corners_x(at);
        const float4 origin = axis ? fma(place, r->sy, r->oy) : fma(place, r->sx, r->ox);
        const float4 slope = axis ? fma(place, r->ty, r->dy) : fma(place, r->tx, r->dx);
        const float4 near = origin + depths.x * slope, far = origin + depths.y * slope;
        box.lo[axis] = least_of(min(near, far));
        box.hi[axis] = most_of(max(near, far));
    }
    box.lo[2] = depths.x;
    box.hi[2] = depths.y;
    for (int k = 0; k < 3; ++k) {
        const float slack = HIT_SLACK * max(fabs(box.lo[k]), fabs(box.hi[k]));
        box.lo[k] -= slack;
        box.hi[k] += slack;
    }
    return box;
}

// A vector that is only known to lie within a box.
typedef struct { float3 at, off; } Loose;

// The largest value of a . b.
inline float most_dot(Loose a, Loose b)
{
    const float noise = inner_product(fabs(a.at), fabs(b.at));
    return inner_product(a.at, b.at) + BOUND_SLACK * inner_product(fabs(a.at), b.off) +
           BOUND_SLACK * inner_product(a.off, fabs(b.at) + b.off) + 17.0f * ROUNDING * noise;
}
inline Loose opposite(Loose a)
{
    const Loose b = {-a.at, a.off};
    return b;
}

// Normals over a rectangle turned to the viewer; false where some may have to be turned and some
// not.
inline int viewed_normals(global const PlaneEquations *p, const Bundle *r, Rectangle at,
                          Loose *normal)
{
    const Loose flat = {vload3(0, p->normal), 0.0f};
    *normal = flat;
    if (!SMOOTH) return 1;
    const float3 one = vload3(0, p->slot[ONE]), x = vload3(0, p->slot[X]);
    const float3 y = vload3(0, p->slot[Y]);
    const float3 noise = 17.0f * ROUNDING * (fabs(x * at.x) + fabs(y * at.y) + fabs(one));
    const Loose n = {fma(x, at.x, fma(y, at.y, one)),
                     fma(fabs(x), at.wide, fma(fabs(y), at.high, noise))};
    const Loose view = {(float3)(fma(at.x, r->tx, r->dx), fma(at.y, r->ty, r->dy), 1.0f),
                        (float3)(at.wide * fabs(r->tx), at.high * fabs(r->ty), 0.0f)};
    if (most_dot(n, view) < 0.0f) *normal = n;
    else if (most_dot(opposite(n), view) < 0.0f) *normal = opposite(n);
    else return 0;
    return 1;
}

// Whether no ray in a rectangle that meets one triangle, within `box`, meets a side that faces the
// light, or the light turns its back on all of them.
inline int turned_away(global const PlaneEquations *p, const Bundle *r, Rectangle at,
                       global const float *light, const Box *box)
{
    Loose normal, towards = {light_vector(light), 0.0f};
    if (!viewed_normals(p, r, at, &normal)) return 0;
    if (is_point(light)) {
        const float3 low = vload3(0, box->lo), high = vload3(0, box->hi);
        towards.off = 0.5f * (high - low) + 17.0f * ROUNDING * fabs(towards.at);
        towards.at -= 0.5f * (low + high);
        const Loose back = {-emitter_normal(light), 0.0f};
        if (most_dot(back, towards) < 0.0f) return 1;
    }
    return most_dot(normal, towards) < 0.0f;
}

#endif
