// The exact reflectance of smooth dielectrics.
//
// Source: B. Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007.
#pragma once
#include "lanes.cl"
#include "numerics.cl"

// Reflectance of smooth dielectrics for unpolarised light; `eta` is the index in front over that
// behind, and the cosine that in front.
inline vf dielectric(vf cosine, vf eta)
{
    cosine = clamp(cosine, (vf)(0.0f), (vf)(1.0f));
    const vf square = eta * eta * (1.0f - cosine * cosine);
    const vf behind = sqrt(max(1.0f - square, (vf)(0.0f)));
    const vf across = (eta * cosine - behind) / max(eta * cosine + behind, (vf)(NOTHING_LEFT));
    const vf along = (cosine - eta * behind) / max(cosine + eta * behind, (vf)(NOTHING_LEFT));
    const vf part = 0.5f * (across * across + along * along);
    return pick(pick(part, (vf)(1.0f), GE(square, (vf)(1.0f))), (vf)(0.0f), EQ(eta, (vf)(1.0f)));
}
