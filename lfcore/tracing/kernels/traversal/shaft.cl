// The volume between a light and a box of hit points.
//
// Source: E. A. Haines, J. R. Wallace, "Shaft Culling for Efficient Ray-Cast Radiosity", 1991.
#pragma once
#include "block.cl"

// An axis-aligned box, and in each coordinate plane the two lines that touch the box of hit points
// as seen from the light: na xa + nb xb <= limit within.  Pairs are (x, y), (y, z), (z, x), two
// lines each.
typedef struct {
    float lo[3], hi[3];
    float na[6], nb[6], limit[6];
} Shaft;

// A line beyond which nothing of the box lies.
inline void set_line(Shaft *shaft, int line, float na, float nb, const Box *box, float size)
{
    const int a = line / 2, b = (a + 1) % 3;
    const float most = max(na * box->lo[a], na * box->hi[a]) +
                       max(nb * box->lo[b], nb * box->hi[b]);
    shaft->na[line] = na;
    shaft->nb[line] = nb;
    shaft->limit[line] = most + SHAFT_SLACK * (fabs(na) + fabs(nb)) * size;
}

// The two lines of a pair: along a directional light, or from a point light to the corners farthest
// to either side.  From within the box nothing is beyond them.
inline void touch_box(Shaft *shaft, int pair, const float *light, int is_point, const Box *box,
                      float size)
{
    const int a = pair, b = (pair + 1) % 3;
    const float2 from = (float2)(light[a], light[b]);
    const float2 low = (float2)(box->lo[a], box->lo[b]), high = (float2)(box->hi[a], box->hi[b]);
    const int within = is_point && all(from >= low) && all(from <= high);
    float2 left = 0.0f, right = 0.0f;
    for (int k = 0; k < 4 && !within; ++k) {
        const float2 corner = (float2)(k & 1 ? high.x : low.x, k & 2 ? high.y : low.y);
        const float2 to = (is_point ? corner : 0.0f) - from;
        if (k == 0 || left.x * to.y - left.y * to.x > 0.0f) left = to;
        if (k == 0 || right.x * to.y - right.y * to.x < 0.0f) right = to;
    }
    set_line(shaft, 2 * pair, -left.y, left.x, box, size);
    set_line(shaft, 2 * pair + 1, right.y, -right.x, box, size);
}

// `light` is a place or, of a directional light, the direction towards it; the box bounds the
// points.
inline Shaft make_shaft(const float *light, int is_point, const Box *box)
{
    Shaft shaft;
    float size = 0.0f;
    for (int k = 0; k < 3; ++k) {
        size = max(size, max(fabs(box->lo[k]), fabs(box->hi[k])));
        if (is_point) size = max(size, fabs(light[k]));
    }
    for (int k = 0; k < 3; ++k) {
        const float margin = SHAFT_SLACK * size;
        const float low = box->lo[k] - margin, high = box->hi[k] + margin;
        shaft.lo[k] = is_point ? min(low, light[k] - margin) : light[k] < 0.0f ? -FAR : low;
        shaft.hi[k] = is_point ? max(high, light[k] + margin) : light[k] > 0.0f ? FAR : high;
    }
    for (int pair = 0; pair < 3; ++pair) touch_box(&shaft, pair, light, is_point, box, size);
    return shaft;
}

// Mask of the LANES boxes that reach into the shaft.
inline vi shaft_overlaps(const Shaft *shaft, global const Boxes *boxes)
{
    vi miss = 0;
    for (int k = 0; k < 3; ++k)
        miss |= GT(VLOAD(boxes->low[k]), (vf)(shaft->hi[k])) |
                LT(VLOAD(boxes->high[k]), (vf)(shaft->lo[k]));
    for (int line = 0; line < 6; ++line) {
        const int a = line / 2, b = (a + 1) % 3;
        const float na = shaft->na[line], nb = shaft->nb[line];
        const vf xa = VLOAD(na > 0.0f ? boxes->low[a] : boxes->high[a]);
        const vf xb = VLOAD(nb > 0.0f ? boxes->low[b] : boxes->high[b]);
        miss |= GT(fma(xa, (vf)(na), xb * nb), (vf)(shaft->limit[line]));
    }
    return ~miss;
}

// Mask of LANES triangles whose corners all lie beyond one face of the shaft.
inline vi shaft_misses(const Shaft *shaft, global const Leaf *leaf)
{
    Triple v[3];
    vi miss = 0;
    for (int axis = 0; axis < 3; ++axis) {
        for (int k = 0; k < 3; ++k) v[axis].of[k] = VLOAD(leaf->corner[k][axis]);
        miss |= GT(least3(v[axis]), (vf)(shaft->hi[axis])) |
                LT(most3(v[axis]), (vf)(shaft->lo[axis]));
    }
    for (int line = 0; line < 6; ++line) {
        const float na = shaft->na[line], nb = shaft->nb[line];
        const Triple *a = v + line / 2, *b = v + (line / 2 + 1) % 3;
        Triple beyond;
        for (int k = 0; k < 3; ++k) beyond.of[k] = fma(a->of[k], (vf)(na), b->of[k] * nb);
        miss |= GT(least3(beyond), (vf)(shaft->limit[line]));
    }
    return miss;
}
