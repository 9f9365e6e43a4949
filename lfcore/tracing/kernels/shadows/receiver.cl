// Receiver planes: shadows on the rays of one element that meet one triangle.
//
// A hit point times the denominator of its depth is affine over the rays: rays of a pixel meet in
// its focus point, rays of a view in the lens sample, and either way the map to the plane is a
// homography. So the affine functions of occluders are affine over the rays, too, and are tested as
// triangles are.
#pragma once
#include "shadow_mask.cl"

// Hit points, relative to a place, times the weight, and the weight, which is positive over the
// rectangle: of each the terms ONE, X and Y.
typedef struct { float3 place[3]; Affine weight; } Receiver;

inline Receiver make_receiver(const Bundle *r, global const PlaneEquations *p)
{
    const Affine z = p->numerator, w = p->denominator;
    const float3 o = (float3)(r->ox, r->oy, 0.0f), d = (float3)(r->dx, r->dy, 1.0f);
    const float3 sx = (float3)(r->sx, 0.0f, 0.0f), tx = (float3)(r->tx, 0.0f, 0.0f);
    const float3 sy = (float3)(0.0f, r->sy, 0.0f), ty = (float3)(0.0f, r->ty, 0.0f);
    Receiver f = {.weight = w};
    f.place[ONE] = o * w.of[ONE] + z.of[ONE] * d;
    f.place[X] = sx * w.of[ONE] + o * w.of[X] + z.of[X] * d + z.of[ONE] * tx;
    f.place[Y] = sy * w.of[ONE] + o * w.of[Y] + z.of[Y] * d + z.of[ONE] * ty;
    return f;
}

// An affine function of hit points relative to that place, times the weight.
inline WideAffine project_plane(const Receiver *f, Plane p)
{
    WideAffine e;
    for (int k = 0; k < 3; ++k) {
        const float3 at = f->place[k];
        const vf last = fma(p.n.z, (vf)(at.z), p.c * f->weight.of[k]);
        e.of[k] = fma(p.n.x, (vf)(at.x), fma(p.n.y, (vf)(at.y), last));
    }
    return e;
}
