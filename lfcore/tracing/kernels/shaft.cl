// What may stand between a light and a box of hit points: the hierarchy is walked with the hull of both.
#ifndef LFCORE_SHAFT_CL
#define LFCORE_SHAFT_CL
#include "facets.cl"

// The volume between a light and a box of hit points: an axis-aligned box, and in each coordinate
// plane the two lines that touch the box as seen from the light.
typedef struct {
    float lo[3], hi[3];
    float na[6], nb[6], limit[6];  // (na xa + nb xb) <= limit within; pairs (x,y) (y,z) (z,x), two each
} Shaft;

inline void touch(Shaft *shaft, int plane, float na, float nb, float limit, float size)
{
    shaft->na[plane] = na;
    shaft->nb[plane] = nb;
    shaft->limit[plane] = limit + 4.0e-6f * (fabs(na) + fabs(nb)) * size;
}

// `light` is (LIGHT,); lo and hi bound the hit points.
inline Shaft make_shaft(global const float *light, const float *lo, const float *hi)
{
    Shaft shaft;
    const int is_point = IS_POINT(light);
    float size = 0.0f;
    for (int k = 0; k < 3; ++k) {
        size = max(size, max(fabs(lo[k]), fabs(hi[k])));
        if (is_point) size = max(size, fabs(light[k]));
    }
    for (int k = 0; k < 3; ++k) {
        const float margin = 4.0e-6f * size;
        shaft.lo[k] = is_point ? min(lo[k], light[k]) - margin : light[k] < 0.0f ? -FAR : lo[k] - margin;
        shaft.hi[k] = is_point ? max(hi[k], light[k]) + margin : light[k] > 0.0f ? FAR : hi[k] + margin;
    }
    for (int pair = 0; pair < 3; ++pair) {
        const int a = pair, b = (pair + 1) % 3;
        touch(&shaft, 2 * pair, 0.0f, 0.0f, 1.0f, 0.0f);
        touch(&shaft, 2 * pair + 1, 0.0f, 0.0f, 1.0f, 0.0f);
        if (is_point) {
            if (light[a] >= lo[a] && light[a] <= hi[a] && light[b] >= lo[b] && light[b] <= hi[b]) continue;
            // Directions from the light to the corners farthest to either side.
            float la = lo[a] - light[a], lb = lo[b] - light[b], ra = la, rb = lb;
            for (int k = 1; k < 4; ++k) {
                const float va = (k & 1 ? hi[a] : lo[a]) - light[a], vb = (k & 2 ? hi[b] : lo[b]) - light[b];
                if (la * vb - lb * va > 0.0f) { la = va; lb = vb; }
                if (ra * vb - rb * va < 0.0f) { ra = va; rb = vb; }
            }
            touch(&shaft, 2 * pair, -lb, la, la * light[b] - lb * light[a], size);
            touch(&shaft, 2 * pair + 1, rb, -ra, rb * light[a] - ra * light[b], size);
        } else if (light[a] != 0.0f || light[b] != 0.0f) {
            const float na = -light[b], nb = light[a];
            touch(&shaft, 2 * pair, na, nb, max(na * lo[a], na * hi[a]) + max(nb * lo[b], nb * hi[b]), size);
            touch(&shaft, 2 * pair + 1, -na, -nb, max(-na * lo[a], -na * hi[a]) + max(-nb * lo[b], -nb * hi[b]), size);
        }
    }
    return shaft;
}

inline vi shaft_meets(const Shaft *shaft, global const float *boxes, int pitch)
{
    vi miss = 0;
    for (int k = 0; k < 3; ++k)
        miss |= GT(VLOAD(boxes + k * pitch), (vf)(shaft->hi[k])) | LT(VLOAD(boxes + (3 + k) * pitch), (vf)(shaft->lo[k]));
    for (int plane = 0; plane < 6; ++plane) {
        const int a = plane / 2, b = (a + 1) % 3;
        const float na = shaft->na[plane], nb = shaft->nb[plane];
        const vf xa = VLOAD(boxes + (na > 0.0f ? a : 3 + a) * pitch), xb = VLOAD(boxes + (nb > 0.0f ? b : 3 + b) * pitch);
        miss |= GT(fma(xa, (vf)(na), xb * nb), (vf)(shaft->limit[plane]));
    }
    return ~miss;
}

// Triangles of a leaf whose corners all lie beyond one face of the shaft.
inline vi shaft_misses(const Shaft *shaft, global const float *leaf)
{
    vf v[3][3];
    for (int k = 0; k < 3; ++k)
        for (int axis = 0; axis < 3; ++axis) v[k][axis] = VLOAD(leaf + (3 * k + axis) * NODE_WIDTH);
    vi miss = 0;
    for (int axis = 0; axis < 3; ++axis) {
        miss |= GT(min(v[0][axis], min(v[1][axis], v[2][axis])), (vf)(shaft->hi[axis]));
        miss |= LT(max(v[0][axis], max(v[1][axis], v[2][axis])), (vf)(shaft->lo[axis]));
    }
    for (int plane = 0; plane < 6; ++plane) {
        const int a = plane / 2, b = (a + 1) % 3;
        vf least = FAR;
        for (int k = 0; k < 3; ++k) least = min(least, fma(v[k][a], (vf)(shaft->na[plane]), v[k][b] * shaft->nb[plane]));
        miss |= GT(least, (vf)(shaft->limit[plane]));
    }
    return miss;
}

inline void gather_shaft(const Bvh *bvh, const Shaft *shaft, Walk *walk, LeafList *list)
{
    while (walk->size && list->count <= list->pitch - NODE_WIDTH) {
        const int node = walk->node[--walk->size];
        global const float *boxes = bvh->boxes + node * 6 * NODE_WIDTH;
        uint bits = 0;
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
            bits |= row_bits(shaft_meets(shaft, boxes + lane, NODE_WIDTH)) << lane;
        descend(bvh, node, bits, walk, list);
    }
}

// Numbers of leaves within the shaft, until there is no room for those of another node or nothing is left.
inline int gather_leaves(const Bvh *bvh, const Shaft *shaft, Walk *walk, int room, global int *leaves)
{
    int count = 0;
    while (walk->size && count <= room - NODE_WIDTH) {
        const int node = walk->node[--walk->size];
        global const float *boxes = bvh->boxes + node * 6 * NODE_WIDTH;
        for (int first = 0; first < NODE_WIDTH; first += LANES)
            for (uint bits = row_bits(shaft_meets(shaft, boxes + first, NODE_WIDTH)); bits; bits &= bits - 1) {
                const int child = bvh->children[node * NODE_WIDTH + first + lowest(bits)];
                if (child < 0) leaves[count++] = -1 - child;
                else walk->node[walk->size++] = child;
            }
    }
    return count;
}

// The same of those on a list.
inline int pick_leaves(const Shaft *shaft, const LeafList *list, global int *leaves)
{
    int count = 0;
    for (int base = 0; base < list->count; base += LANES) {
        uint near = row_bits(shaft_meets(shaft, list->boxes + base, list->pitch));
        if (base + LANES > list->count) near &= (1u << (list->count - base)) - 1u;
        for (; near; near &= near - 1) leaves[count++] = list->leaf[base + lowest(near)];
    }
    return count;
}

inline void start_walk(Walk *walk)
{
    walk->node[0] = 0;
    walk->z[0] = 0.0f;
    walk->size = 1;
}

#endif
