// Receiver planes: shadows on the rays of one element that meet one triangle.
//
// A hit point times the denominator of its depth is affine over the rays: rays of a pixel meet in
// its focus point, rays of a view in the lens sample, and either way the map to the plane is a
// homography. So the affine functions of occluders are affine over the rays, too, and are tested as
// triangles are.
#pragma once
#include "shadow_mask.cl"

// (P - apex) times the weight, and the weight, which is positive over the rectangle: of each the
// terms ONE, X and Y.
typedef struct { float3 place[3]; float weight[3]; } Receiver;

inline Receiver make_receiver(const Bundle *r, global const PlaneEquations *p, float3 apex)
{
    const Affine z = p->numerator, w = p->denominator;
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

inline WideAffine project_plane(const Receiver *f, Plane p)
{
    WideAffine e;
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
    return box;
}
