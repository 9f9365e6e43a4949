// The least and the most of three quantities over rows of rays, and the box that they make.
#ifndef LFCORE_RANGES_CL
#define LFCORE_RANGES_CL
#include "block.cl"

typedef struct { float lo[3], hi[3]; } Box;

// In each lane.
typedef struct { vf low[3], high[3]; } Ranges;

inline void clear_ranges(Ranges *r)
{
    for (int k = 0; k < 3; ++k) {
        r->low[k] = FAR;
        r->high[k] = -FAR;
    }
}

inline void add_to_ranges(Ranges *r, Vec a, vi mask)
{
    const vf x[3] = {a.x, a.y, a.z};
    for (int k = 0; k < 3; ++k) {
        r->low[k] = pick(r->low[k], min(r->low[k], x[k]), mask);
        r->high[k] = pick(r->high[k], max(r->high[k], x[k]), mask);
    }
}

// Around what was added; lows lie beyond highs if that is nothing.
inline Box box_of(const Ranges *r)
{
    Box box;
    for (int k = 0; k < 3; ++k) {
        box.lo[k] = row_min(r->low[k]);
        box.hi[k] = row_max(r->high[k]);
    }
    return box;
}

#endif
