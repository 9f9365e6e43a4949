// What is shaded together: a row of rays' surfaces, of one material.
#ifndef LFCORE_SURFACE_ROW_CL
#define LFCORE_SURFACE_ROW_CL
#include "samples.cl"

typedef struct {
    const Material *material;
    Colour albedo;
    // Normal and direction to the viewer are of unit length; the latter of what shines alone.
    Vec point, normal, view;
    // Of PHYSICAL scenes: the normal that no map bends, metal, the fourth power of roughness, what
    // glows.
    Vec unbent;
    vf metallic, alpha2;
    Colour glow;
} Surface;

inline void add_colour(Colour *sum, vf amount, float3 colour)
{
    sum->r = fma(amount, (vf)(colour.x), sum->r);
    sum->g = fma(amount, (vf)(colour.y), sum->g);
    sum->b = fma(amount, (vf)(colour.z), sum->b);
}

inline Colour pick_colour(Colour a, Colour b, vi mask)
{
    const Colour c = {pick(a.r, b.r, mask), pick(a.g, b.g, mask), pick(a.b, b.b, mask)};
    return c;
}

#endif
