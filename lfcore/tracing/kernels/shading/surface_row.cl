// What is shaded together: a row of rays' surfaces, of one material.
#ifndef LFCORE_SURFACE_ROW_CL
#define LFCORE_SURFACE_ROW_CL
#include "samples.cl"

typedef struct {
    const Material *material;
    Vec albedo;
    // Normal and direction to the viewer are of unit length; the latter of what shines alone.
    Vec point, normal, view;
    // Of PHYSICAL scenes: the normal that no map bends, metal, the fourth power of roughness, what
    // glows.
    Vec unbent;
    vf metallic, alpha2;
    Vec glow;
} Surface;

#endif
