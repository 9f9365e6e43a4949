// Samples of video frames: codes of BITS (8, 10 or 12) bits, the latter two in words of 16.
#pragma once
#include "lanes.cl"

#if BITS == 8
#define SAMPLE uchar
#else
#define SAMPLE ushort
#endif
#define SAMPLES(n) JOIN(SAMPLE, n)
typedef SAMPLE sample;
#define CODES (BITS > 8 ? 1 << (BITS - 8) : 1)  // per code of 8 bits
