// Bounds of rounding errors, as numbers of roundings, which docs/numerics.md counts or measures.
//
// A number that passes n roundings has a relative error of at most GAMMA(n).  Source: N. J. Higham,
// "Accuracy and Stability of Numerical Algorithms", 2002, section 3.1; M. Pharr, W. Jakob, G.
// Humphreys, "Physically Based Rendering", section 6.8.
#pragma once

#ifndef ROUNDING  // tests halve it
#define ROUNDING 5.9604645e-8f  // half the unit in the last place of 1
#endif
#define GAMMA(n) ((n) * ROUNDING / (1.0f - (n) * ROUNDING))

// Below this a function or a square counts as zero: its terms may be denormal, and inexact.
#define NOTHING_LEFT 1.0e-30f
#define LEAST_LENGTH 1.0e-37f  // the least divisor, above the least normal float, 1.2e-38

#define EDGE_ERROR (OUTER > 1 ? GAMMA(9.0f) : GAMMA(7.0f))  // of an edge function at a ray
#define CORNER_ERROR GAMMA(4.0f)           // of corners in a packet and in its blocks
#define BOUND_SLACK (1.0f + GAMMA(6.0f))   // of half extents and spreads, of five magnitudes
#define SWEEP_SLACK (1.0f + GAMMA(9.0f))   // of the time at which a ray or a shaft enters a box
#define FRUSTUM_SLACK GAMMA(7.0f)          // of frusta against boxes
#define SIDE_SLACK GAMMA(6.0f)             // of the least of an affine function over rays
#define LIGHT_SPACE_ERROR GAMMA(7.0f)      // of functions of occluders in light space
#define RAY_EDGE_ERROR GAMMA(1.5f)         // of an edge function whose sign is wrong, at a single ray
// The relative distance to a triangle's plane below which the triangle does not shadow a point.
#define SHADOW_MARGIN 1.0e-6f
