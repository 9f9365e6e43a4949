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

// Red, green and blue are x, y and z here.
inline Vec colour_of(Colour c) { return (Vec){c.r, c.g, c.b}; }

inline Vec plus3(Vec a, Vec b) { return (Vec){a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec times3(Vec a, Vec b) { return (Vec){a.x * b.x, a.y * b.y, a.z * b.z}; }

// k a + b, rounded once.
inline Vec fma3(vf k, Vec a, Vec b)
{
    return (Vec){fma(k, a.x, b.x), fma(k, a.y, b.y), fma(k, a.z, b.z)};
}

#endif
