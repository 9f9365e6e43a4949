// The fixed point of traced light in the sums of sensor planes: sums are integers, exact, and
// independent of the order of rays.
#pragma once
#include "colours.cl"
#include "lanes.cl"

// Added before fractions are dropped: one half.  Coarse sums add different numbers with this mean,
// so that fractions of equal rays count.
#define SPREAD 1, 17, 9, 25, 5, 21, 13, 29, 3, 19, 11, 27, 7, 23, 15, 31
#if LANES == 1
constant float HALVES[16] = {SPREAD};
inline float halves_at(int x, int coarse) { return coarse ? HALVES[x % 16] / 32.0f : 0.5f; }
#else
inline float16 halves_at(int x, int coarse)
{
    return coarse ? (float16)(SPREAD) / 32.0f : (float16)(0.5f);
}
#endif
