// Highlights of Blinn-Phong materials.
//
// Source: J. F. Blinn, "Models of Light Reflection for Computer Synthesized Pictures", SIGGRAPH
// 1977.
#pragma once
#include "powers.cl"
#include "samples.cl"

// A highlight: a power of the cosine between the normal and halfway to the viewer.
inline vf highlight(const Surface *s, Vec towards, vi facing)
{
    const Vec h = plus3(towards, s->to_viewer);
    const vf halfway = dot3(s->normal, h) * inverse_sqrt(max(dot3(h, h), (vf)(NOTHING_LEFT)));
    const vi glossy = facing & GE(halfway, (vf)(s->material->specular_cutoff));
    if (!row_any(glossy)) return 0.0f;
    const vf cosine = max(halfway, (vf)(NOTHING_LEFT));
    const vf power = exp2_fast(s->material->shininess * log2_fast(cosine));
    return pick((vf)(0.0f), power, glossy);
}
