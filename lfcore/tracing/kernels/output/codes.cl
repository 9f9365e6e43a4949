// Codes of video frames: BITS is 8, or 10 in 16-bit words; 0 where no frames are written.
#pragma once
#include "lanes.cl"

#if BITS == 8
#define SAMPLE uchar
#else
#define SAMPLE ushort
#endif
typedef SAMPLE sample;
#define SAMPLES(n) JOIN(SAMPLE, n)
#define CODES (BITS == 10 ? 4 : 1)  // to one of 8 bits
