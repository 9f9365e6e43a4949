// The fixed point of traced light in the sums of sensor planes: sums are integers, exact, and
// independent of the order of rays.  Light reaches STOPS above white.
#pragma once
#include "colours.cl"
#include "lanes.cl"

#define BRIGHTEST ((float)(1 << STOPS))
// Radiance 1: the 32 rays of a strip's column, all of BRIGHTEST, have a sum of 32 bits.
#define COARSE (STOPS > SPARE_STOPS)
#define ONE_OF_SUMS (FIXED_ONE / (COARSE ? 1 << (STOPS - SPARE_STOPS) : 1))

// Added before fractions are dropped: one half.  Coarse sums add different numbers with this mean,
// so that fractions of equal rays count.
#define SPREAD 1, 17, 9, 25, 5, 21, 13, 29, 3, 19, 11, 27, 7, 23, 15, 31
#if LANES == 1
constant float HALVES[16] = {SPREAD};
inline float halves_at(int x) { return COARSE ? HALVES[x % 16] / 32.0f : 0.5f; }
#else
inline float16 halves_at(int x) { return COARSE ? (float16)(SPREAD) / 32.0f : (float16)(0.5f); }
#endif
