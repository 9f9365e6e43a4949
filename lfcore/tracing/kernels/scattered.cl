// Blocks that would each meet thousands of triangles are traced ray by ray: what a block shares is then
// far less than what it would have to set up.
#ifndef LFCORE_SCATTERED_CL
#define LFCORE_SCATTERED_CL
#include "walk.cl"

// Depths and triangles of the rays of a block that lie in its first columns and rows; the others miss.
inline void see_rays(const Bvh *bvh, const Bundle *r, int columns, int rows, global float *z, global int *ids)
{
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        const int i = at % BLOCK, j = at / BLOCK;
        const float x = i - HALF, y = j - HALF;
        Hit hit = {FAR, -1, (float3)(0.0f)};
        int exponent = 0;
        if (i < columns && j < rows) {
            const float3 origin = (float3)(fma(x, r->sx, r->ox), fma(y, r->sy, r->oy), 0.0f);
            const Ray ray = scaled_ray(origin, (float3)(fma(x, r->tx, r->dx), fma(y, r->ty, r->dy), 1.0f), &exponent);
            closest_hit(bvh, &ray, &hit);
        }
        z[at] = hit.id < 0 ? INFINITY : ldexp(hit.t, -exponent);
        ids[at] = hit.id;
    }
}

#ifdef SHADOW_MARGIN
// Whether a leaf holds a triangle, other than `own` and the `light`'s, between the ray's origin and `far`.  What lies within
// the rounding of the numbers that enter is not in between, as in shadows.cl.
inline int leaf_blocks(const Bvh *bvh, const Ray *r, int leaf, float far, int own, int2 light)
{
    for (int part = 0; part < NODE_WIDTH; part += LANES) {
        global const float *at = bvh->leaves + leaf * 9 * NODE_WIDTH + part;
        Sheared s;
        shear_leaf(r, at, &s);
        if (!row_any(s.mask)) continue;
        const vf t = sheared_time(r, &s);
        global const int *ids = bvh->leaf_ids + leaf * NODE_WIDTH + part;
        s.mask &= GT(t, (vf)(0.0f)) & LT(t, (vf)(far)) & ~(EQ(VLOAD(ids), (vi)(own)) | are_own(light, ids));
        if (!row_any(s.mask)) continue;
        vf p[3], a[3], b[3];
        for (int k = 0; k < 3; ++k) {
            p[k] = VLOAD(at + k * NODE_WIDTH);
            a[k] = VLOAD(at + (3 + k) * NODE_WIDTH) - p[k];
            b[k] = VLOAD(at + (6 + k) * NODE_WIDTH) - p[k];
        }
        vf off = 0.0f, margin = 0.0f;
        for (int k = 0; k < 3; ++k) {
            const float o = axis(r->origin, k);
            const vf n = a[(k + 1) % 3] * b[(k + 2) % 3] - a[(k + 2) % 3] * b[(k + 1) % 3];
            off = fma(n, p[k] - o, off);
            margin = fma(fabs(n), fabs(p[k]) + fabs(o), margin);
        }
        if (row_any(s.mask & GT(fabs(off), SHADOW_MARGIN * margin))) return 1;
    }
    return 0;
}

// The leaf that blocks the ray nearer than `far`, or -1.
inline int blocking_leaf(const Bvh *bvh, const Ray *r, float far, int own, int2 light)
{
    Walk walk;
    private float near[NODE_WIDTH];
    walk.node[0] = 0; walk.size = 1;
    while (walk.size) {
        const int node = walk.node[--walk.size];
        global const int *children = bvh->children + node * NODE_WIDTH;
        uint bits = 0;
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES)
            bits |= row_bits(ray_meets(r, bvh->boxes + node * 6 * NODE_WIDTH + lane, NODE_WIDTH, far, near + lane)) << lane;
        for (; bits; bits &= bits - 1) {
            const int child = children[lowest(bits)];
            if (child >= 0) walk.node[walk.size++] = child;
            else if (leaf_blocks(bvh, r, -1 - child, far, own, light)) return -1 - child;
        }
    }
    return -1;
}

// The same among the leaves of a list, whose count was rounded up to LANES with boxes that nothing meets.
inline int blocking_listed(const Bvh *bvh, const LeafList *list, const Ray *r, float far, int own, int2 light)
{
    private float near[LANES];
    for (int base = 0; base < list->count; base += LANES)
        for (uint bits = row_bits(ray_meets(r, list->boxes + base, list->pitch, far, near)); bits; bits &= bits - 1) {
            const int leaf = list->leaf[base + lowest(bits)];
            if (leaf_blocks(bvh, r, leaf, far, own, light)) return leaf;
        }
    return -1;
}

// List what may stand between the light and the hit points in `wants`: of `beam`, if that is given, all for
// the whole beam.  False if it is too much for the list.
inline int narrow_list(const Bvh *bvh, global const float *light, const LeafList *beam, global const float *point, global const int *wants,
                       LeafList *list)
{
    float lo[3], hi[3];
    for (int k = 0; k < 3; ++k) {
        vf low = FAR, high = -FAR;
        for (int at = 0; at < BLOCK_RAYS; at += LANES) {
            const vf x = VLOAD(point + k * BLOCK_RAYS + at);
            const vi want = VLOAD(wants + at);
            low = pick(low, min(low, x), want);
            high = pick(high, max(high, x), want);
        }
        lo[k] = row_min(low);
        hi[k] = row_max(high);
    }
    list->count = 0;
    if (lo[0] > hi[0]) return 1;
    const Shaft shaft = make_shaft(light, lo, hi);
    if (!beam) {
        Walk walk;
        start_walk(&walk);
        gather_shaft(bvh, &shaft, &walk, list);
        if (walk.size) return 0;
    }
    for (int base = 0; beam && base < beam->count; base += LANES) {
        uint near = row_bits(shaft_meets(&shaft, beam->boxes + base, beam->pitch));
        if (base + LANES > beam->count) near &= (1u << (beam->count - base)) - 1u;
        for (; near; near &= near - 1) {
            const int from = base + lowest(near), to = list->count++;
            for (int k = 0; k < 6; ++k) list->boxes[k * list->pitch + to] = beam->boxes[k * beam->pitch + from];
            list->leaf[to] = beam->leaf[from];
        }
    }
    for (; list->count % LANES; ++list->count)
        for (int k = 0; k < 6; ++k) list->boxes[k * list->pitch + list->count] = k < 3 ? FAR : -FAR;
    return 1;
}

// A list pays for itself with the rays of a whole block.
#define LISTED (!SCATTERED && (OUTER > 1 || HALF > 5.0f))

// Take from `wants` the rays of a block that cannot see the light, one by one.
inline void shadow_rays_singly(const Bvh *bvh, global const float *light, const LeafList *beam, LeafList *list,
                               global const int *ids, global const float *point, global int *wants)
{
    const int listed = LISTED && narrow_list(bvh, light, beam, point, wants, list);
    const int2 emitter = own_triangles(light);
    int last = -1;  // what darkened a neighbour is likely to darken the next
    for (int at = 0; at < BLOCK_RAYS; ++at) {
        if (!wants[at]) continue;
        const float3 p = (float3)(point[at], point[BLOCK_RAYS + at], point[2 * BLOCK_RAYS + at]);
        int exponent;
        const Ray ray = scaled_ray(p, IS_POINT(light) ? vload3(0, light) - p : vload3(0, light), &exponent);
        const float far = IS_POINT(light) ? ldexp(1.0f, exponent) : FAR;
        if (last < 0 || !leaf_blocks(bvh, &ray, last, far, ids[at], emitter))
            last = listed ? blocking_listed(bvh, list, &ray, far, ids[at], emitter) : blocking_leaf(bvh, &ray, far, ids[at], emitter);
        if (last >= 0) wants[at] = 0;
    }
}
#endif

#endif
