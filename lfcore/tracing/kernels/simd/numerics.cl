// Bounds of rounding errors, as counts of roundings: docs/numerics.md says which are counted term
// by term, and which are measured.
//
// A number that passes n roundings has a relative error of at most GAMMA(n).  Source: N. J. Higham,
// "Accuracy and Stability of Numerical Algorithms", 2002, section 3.1; M. Pharr, W. Jakob, G.
// Humphreys, "Physically Based Rendering", section 6.8.
#pragma once

#define ROUNDING 5.9604645e-8f  // half the unit in the last place of 1
#define GAMMA(n) ((n) * ROUNDING / (1.0f - (n) * ROUNDING))

// Below this a function or a square counts as zero: its terms may be denormal, and inexact.
#define NOTHING_LEFT 1.0e-30f
// The least divisor of a length: above the least normal float, 1.2e-38.
#define LEAST_LENGTH 1.0e-37f

// Edge functions: sum, difference, product and their difference (4), the widening (1), evaluation
// at a ray (2; with u and v 4).
#define EDGE_ERROR (OUTER > 1 ? GAMMA(9.0f) : GAMMA(7.0f))
// Corners: difference and fma (2), and the centre rays of a packet and of its blocks (2).
#define CORNER_ERROR GAMMA(4.0f)
// Corners relative to the centre rays of a packet and of a block: in both a centre, a difference
// and an fma, of which all but the last (4) are in proportion to the centre ray; the bound (1).
#define PACKET_ERROR GAMMA(5.0f)
// A half extent or a spread: five roundings of positive terms, and the product with the bound.
#define BOUND_SLACK (1.0f + GAMMA(6.0f))
// A ray's entry into a box: T. Ize, "Robust BVH Ray Traversal", JCGT 2(2), 2013, has 3 for the far
// end and as many for the near one, and the bound is rounded once.
#define RAY_SLACK (1.0f + GAMMA(7.0f))
// Frusta, in proportion to centre rays: those of packet and block (2), the widening (1), two sums
// (2) or a sum and a corner's difference; to half extents: product, two fmas and a sum (4), a
// corner's difference and fma (2); the bound (1).  Rows of edge functions have six, too.
#define FRUSTUM_SLACK GAMMA(7.0f)
// Hit points on a triangle, in proportion to the terms of n . P over n . D: measured, at most 10
// roundings.
#define HIT_SLACK GAMMA(14.0f)
// Columns and rows of a packet in which its blocks find a triangle: measured, at most 6.6
// roundings.
#define COLUMN_SLACK GAMMA(12.0f)
// The least of an affine function over rays: the middle (3), evaluation at a ray (2), the bound
// (1).
#define SIDE_SLACK GAMMA(6.0f)
// Lines of shafts, in proportion to the box of hit points: products and sum (2) and the slack's own
// sum (1); evaluation at an occluder up to 64 times as far from the origin, a product in proportion
// to half of that (32) and an fma (1).
#define SHAFT_SLACK GAMMA(36.0f)
// Functions of occluders in light space: evaluation at a hit point (3); a product, a difference to
// the middle, two sums, those with g's and c's terms (6), c's own (1); the bound (1).
#define LIGHT_SPACE_ERROR GAMMA(11.0f)
// Depths at a block's corners against those at its rays, of numerators and denominators that differ
// by a factor of two at the most: measured, at most 6.1 roundings.  Both places round alike.
#define DEPTH_SLACK GAMMA(10.0f)
// Hit points nearer to a triangle's plane than this share of the terms are not shadowed by it: a
// millionth.  Half of it darkens rays beside a neighbouring triangle, four times it loses contact
// shadows: measured against the float64 oracle.
#define SHADOW_MARGIN 1.0e-6f
// A function whose slope in a row is below this share of its size is constant: over the 64 columns
// of a packet it changes by less than a thousandth of one rounding.
#define LEAST_SLOPE 9.0e-13f
// A constant function that is zero along a row is not negative so many columns to either side: as
// many as a packet has to either side of its centre.
#define MOST_COLUMNS (PACKET_COLUMNS / 2)
