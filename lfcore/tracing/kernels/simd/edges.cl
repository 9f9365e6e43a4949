// The edge equation: which side of the plane through two points and the origin a point is on.
//
// P x Q = (P + Q) x (Q - P) / 2.  The difference of two corners that are near each other is exact,
// so the error of the right side scales with the edge, and that of P x Q with the distance to the
// origin.  Swapping P and Q negates it to the last bit all the same.
#pragma once
#include "lanes.cl"

// Twice P x Q, of LANES edges and of one.
inline Vec edge_normals(Vec p, Vec q) { return cross3(plus3(p, q), minus3(q, p)); }
inline float3 edge_normal(float3 p, float3 q) { return cross_product(p + q, q - p); }
