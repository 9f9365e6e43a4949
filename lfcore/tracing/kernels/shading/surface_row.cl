// A row of rays' surfaces, of one material, which is shaded together.
#ifndef LFCORE_SURFACE_ROW_CL
#define LFCORE_SURFACE_ROW_CL
#include "samples.cl"

typedef struct {
    const Material *material;
    Vec albedo, point;
    Vec normal;     // of unit length
    Vec view;       // direction to the viewer, of unit length; only specular materials have it
    // Scenes with PHYSICAL alone.
    Vec geometric;  // the normal before the normal map
    vf metallic;
    vf alpha2;      // the fourth power of roughness
    Vec emission;
} Surface;

#endif
