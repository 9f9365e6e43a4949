// Triangles against a block: edge functions and the planes of triangles, set up LANES at a time.
//
// In the frame sheared to the block's centre ray, X = x - ox - z dx (Y alike), the edge function of
// p -> q, D . ((p - O) x (q - O)), is affine over the block: the term in O x O vanishes, and so
// does the bilinear one, for lens samples of one pixel as for pixels of one lens sample.  It is
//     e = c_z + i (c_x tx + g_y sx) + j (c_y ty - g_x sy),   c = P x Q,  g = P - Q
// and the code has twice that.  Blocks of several elements add (y u - x v) (sx b - a tx) g_z.
// Depth is that of the triangle's plane, n . X = n . P.
//
// Source of edge functions: J. Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH
// 1988.
#pragma once
#include "packet.cl"

// The edge equation, for coverage, interpolation and shadows: which side of the plane through two
// points and the origin a point is on.
//
// P x Q = (P + Q) x (Q - P) / 2.  The difference of two corners that are near each other is exact,
// so the error of the right side scales with the edge, and that of P x Q with the distance to the
// origin.  Swapping P and Q negates it to the last bit all the same.  Twice P x Q of LANES edges:
inline Vec edge_normals(Vec p, Vec q) { return cross3(plus3(p, q), minus3(q, p)); }

// Corners of LANES triangles in the frame of the block's centre ray.
typedef struct { Triple x, y, z; } Corners;

inline Corners shear_corners(const Bundle *r, global const Leaf *leaf)
{
    Corners c;
    for (int k = 0; k < 3; ++k) {
        const vf z = VLOAD(leaf->corner[k][2]);
        c.x.of[k] = fma(-z, (vf)(r->dx), VLOAD(leaf->corner[k][0]) - r->ox);
        c.y.of[k] = fma(-z, (vf)(r->dy), VLOAD(leaf->corner[k][1]) - r->oy);
        c.z.of[k] = z;
    }
    return c;
}

inline Vec corner_of(const Corners *c, int k)
{
    return (Vec){c->x.of[k], c->y.of[k], c->z.of[k]};
}

// Along one axis: the rays' steps s + z t and, from element to element, a + z b; the half_extent of
// the rays; the triangles' corners at depths z; and a bound of the rounding error of these and of
// the rays beside them.
typedef struct {
    float s, t, a, b, half_extent;
    Triple at, z;
    vf error;
} Axis;

// Of rays whose steps are s and t and whose centre has origin o and direction d.
inline Axis make_axis(const Bundle *r, float s, float t, float o, float d, Triple at, Triple z)
{
    const float origins = fabs(o) + r->half_extent * fabs(s) + OUTER_HALF * fabs(r->a);
    const float directions = fabs(d) + r->half_extent * fabs(t) + OUTER_HALF * fabs(r->b);
    const vf most = largest3(at) + fma(largest3(z), (vf)(directions), (vf)(origins));
    return (Axis){s, t, r->a, r->b, r->half_extent, at, z, CORNER_ERROR * most};
}

// Mask of triangles wholly beside the rays, whichever way they face.  The half width of the rays is
// convex in z, so its larger end bounds it.
inline vi beside_rays(const Axis *a)
{
    const float h = a->half_extent * a->s, g = a->half_extent * a->t;
    const float hu = OUTER_HALF * a->a, gu = OUTER_HALF * a->b;
    const vf nearest = half_span(least3(a->z), h, g, hu, gu);
    const vf limit = fma(max(nearest, half_span(most3(a->z), h, g, hu, gu)), (vf)(BOUND_SLACK),
                         a->error);
    return GT(least3(a->at), limit) | LT(most3(a->at), -limit);
}

// Between which columns (rows, along y) of an element triangles lie, counted from its first ray. At
// depth z neighbouring rays are s + z t apart, and neighbouring elements a + z b.  The map from a
// triangle to the grid is projective: where s + z t keeps its sign over the triangle, the first and
// last column belong to corners.
inline void find_span(const Axis *a, Triple inverse, vf slack, int element, vf *lo, vf *hi)
{
    Triple sample;
    for (int k = 0; k < 3; ++k) {
        const vf apart = fma(a->z.of[k], (vf)(a->b), (vf)(a->a));
        vf at = a->at.of[k];
        if (OUTER > 1) at = fma((vf)(OUTER_HALF - element), apart, at);
        sample.of[k] = at * inverse.of[k];
    }
    *lo = least3(sample) - slack + a->half_extent;
    *hi = most3(sample) + slack + a->half_extent;
}

inline void find_steps(const Axis *a, Triple *step, Triple *inverse)
{
    for (int k = 0; k < 3; ++k) {
        step->of[k] = fma(a->z.of[k], (vf)(a->t), (vf)(a->s));
        inverse->of[k] = reciprocal(step->of[k]);
    }
}

// The block's 16 columns that triangles can reach, a bit each.
inline vi samples_reached(const Axis *a)
{
    Triple step, inverse;
    find_steps(a, &step, &inverse);
    const vf slack = a->error * largest3(inverse);
    vi reached = 0;
    for (int element = 0; element < OUTER; ++element) {
        vf lo, hi;
        find_span(a, inverse, slack, element, &lo, &hi);
        const vi first = TO_VI(clamp(ceil(lo), (vf)(0.0f), (vf)(INNER)));
        const vi end = TO_VI(clamp(floor(hi) + 1.0f, (vf)(0.0f), (vf)(INNER)));
        reached |= max(((vi)(1) << end) - ((vi)(1) << first), (vi)(0)) << (element * INNER);
    }
    const vi one_sided = GT(step.of[0] * step.of[1], (vf)(0.0f)) &
                         GT(step.of[1] * step.of[2], (vf)(0.0f));
    return pick_int((vi)((1 << BLOCK) - 1), reached, one_sided);
}

// LANES triangles of a leaf among the rays of a block.
typedef struct {
    Corners v;
    Axis x, y;
    WideAffine edge[3];  // opposite p, q and r
    vi covers;           // every ray is inside
    vi edge_on;          // some ray sees it edge-on: the sign of n . D changes
    vi flip;             // sign bit of those that were seen from behind
} Placed;

// A bound of what an edge function differs by between a packet and its blocks, whose corners are
// relative to other centre rays, at rays between the edge's corners.  `depths`: at least twice the
// farther one's; `l`: the edge's lengths.
inline vf packet_error(vf depths, Vec l, const Bundle *r)
{
    const float h = 2.0f * r->half_extent;
    const float ox = fma(h, fabs(r->sx), fabs(r->ox)), dx = fma(h, fabs(r->tx), fabs(r->dx));
    const float oy = fma(h, fabs(r->sy), fabs(r->oy)), dy = fma(h, fabs(r->ty), fabs(r->dy));
    const vf x = fma(l.z, (vf)(h * fabs(r->tx)), l.x), y = fma(l.z, (vf)(h * fabs(r->ty)), l.y);
    return PACKET_ERROR * (y * fma(depths, (vf)(dx), 2.0f * (ox + x)) +
                           x * fma(depths, (vf)(dy), 2.0f * (oy + y)));
}

// Twice the edge function from p to q.  `error` receives a bound of its error in the block or, for
// `of_packet`, in the blocks of a packet.
inline WideAffine edge_functions(Vec p, Vec q, const Bundle *r, int of_packet, vf *error)
{
    const Vec sum = plus3(p, q), d = minus3(q, p), c = edge_normals(p, q);
    WideAffine e;
    e.of[ONE] = c.z;
    e.of[X] = fma(c.x, (vf)(r->tx), -2.0f * d.y * r->sx);
    e.of[Y] = fma(c.y, (vf)(r->ty), 2.0f * d.x * r->sy);
    const Vec m = absolute3(sum), l = absolute3(d);
    const vf kx = fma(m.y, l.z, m.z * l.y), ky = fma(m.z, l.x, m.x * l.z);
    const vf wide = fma(kx, (vf)(fabs(r->tx)), 2.0f * l.y * fabs(r->sx)) +
                    fma(ky, (vf)(fabs(r->ty)), 2.0f * l.x * fabs(r->sy));
    vf most = fma((vf)(r->half_extent), wide, fma(m.x, l.y, m.y * l.x));
    if (OUTER > 1) {
        e.of[U] = fma(c.x, (vf)(r->b), -2.0f * d.y * r->a);
        e.of[V] = fma(c.y, (vf)(r->b), 2.0f * d.x * r->a);
        e.of[BILINEAR] = d.z * (-2.0f * (r->sx * r->b - r->a * r->tx));
        const vf outer = fma(kx + ky, (vf)(fabs(r->b)), 2.0f * (l.x + l.y) * fabs(r->a));
        const float steps = fabs(r->sx * r->b) + fabs(r->a * r->tx);
        const vf bilinear = l.z * (4.0f * r->half_extent * OUTER_HALF * steps);
        most += fma((vf)(OUTER_HALF), outer, bilinear);
    }
    *error = EDGE_ERROR * most;
    if (of_packet) *error += *error + packet_error(m.z + l.z, l, r);
    return e;
}

// What an affine function varies by within a block of that half_extent, at most.
inline vf affine_spread(WideAffine e, float half_extent)
{
    vf wide = half_extent * (fabs(e.of[X]) + fabs(e.of[Y]));
    if (OUTER > 1)
        wide += OUTER_HALF * (fabs(e.of[U]) + fabs(e.of[V])) +
                2.0f * half_extent * OUTER_HALF * fabs(e.of[BILINEAR]);
    return wide;
}

// Edges signed so that n . D > 0 unless the triangle is seen edge-on, and then widened by their
// error.  Returns the mask of triangles that some ray may meet.
inline vi place_edges(const Bundle *r, int of_packet, Placed *out)
{
    const Vec p = corner_of(&out->v, 0), q = corner_of(&out->v, 1), w = corner_of(&out->v, 2);
    WideAffine *e = out->edge;
    vf error[3];
    e[0] = edge_functions(q, w, r, of_packet, error);
    e[1] = edge_functions(w, p, r, of_packet, error + 1);
    e[2] = edge_functions(p, q, r, of_packet, error + 2);
    WideAffine sum;  // n . D
    for (int k = 0; k < AFFINE_TERMS; ++k) sum.of[k] = e[0].of[k] + e[1].of[k] + e[2].of[k];
    if (OUTER > 1) sum.of[BILINEAR] = 0.0f;  // the three differences of depth cancel
    const vf middle = sum.of[ONE], wide = affine_spread(sum, r->half_extent);
    const vi flat = EQ(middle, (vf)(0.0f)) & EQ(wide, (vf)(0.0f));
    out->edge_on = LE(fabs(middle), wide * BOUND_SLACK);
    out->flip = LT(middle, (vf)(0.0f)) & ~out->edge_on & (vi)(0x80000000);
    vi outside = 0;
    out->covers = ~out->edge_on;
    for (int k = 0; k < 3; ++k) {
        for (int term = 0; term < AFFINE_TERMS; ++term)
            e[k].of[term] = flip_sign(e[k].of[term], out->flip);
        e[k].of[ONE] += pick((vf)(0.0f), error[k], ~out->edge_on);
        const vf c = e[k].of[ONE], spread = affine_spread(e[k], r->half_extent) * BOUND_SLACK;
        outside |= LT(c + spread, (vf)(-NOTHING_LEFT));
        out->covers &= GE(c, spread + NOTHING_LEFT);
    }
    return ~(flat | (outside & ~out->edge_on));
}

// The affine function one + x (change along the columns) + y (change along the rows).
inline WideAffine stepped_affine(vf one, vf x, vf y, float step_x, float step_y, float outer)
{
    WideAffine f;
    f.of[ONE] = one;
    f.of[X] = x * step_x;
    f.of[Y] = y * step_y;
    if (OUTER > 1) {
        f.of[U] = x * outer;
        f.of[V] = y * outer;
        f.of[BILINEAR] = 0.0f;
    }
    return f;
}

// Depth from the plane n . X = n . P: n is made of edges, so its error scales with the triangle and
// not with its distance, as that of the weighted mean of corners does.
inline void depth_affines(const Corners *v, const Bundle *r, vi flip, WideAffine *over,
                          WideAffine *under)
{
    const Vec p = corner_of(v, 0), a = minus3(corner_of(v, 1), p), b = minus3(corner_of(v, 2), p);
    const Vec n = turn_vectors(cross3(a, b), flip);
    *over = stepped_affine(dot3(n, p), -n.x, -n.y, r->sx, r->sy, r->a);
    *under = stepped_affine(n.z, n.x, n.y, r->tx, r->ty, r->b);
}

// WideAffine of a triangle: edges opposite p, q and r, and depth's.
enum { NUMERATOR = 3, DENOMINATOR, FUNCTIONS };

// LANES triangles set up for a block, as far as they may be hit.
typedef struct {
    uint keep;                        // lanes that may be hit
    uint covers;                      // of those, lanes that every ray of the block is inside of
    uint edge_on;                     // lanes that some ray sees edge-on
    float near[LANES];                // where each begins
    int rows[LANES];                  // rows that each can touch, a bit each
    int columns[LANES];               // and columns
    WideAffine functions[FUNCTIONS];  // signed so that n . D > 0 unless edge-on
} Triangles;

// The function of one of LANES triangles.
inline Affine affine_of(const WideAffine *f, uint lane)
{
    Affine one;
    for (int k = 0; k < AFFINE_TERMS; ++k) one.of[k] = ((const float *)(f->of + k))[lane];
    return one;
}

// Mask of those that rays anywhere in the block may meet, between its samples, too; `of_packet` as
// for edge_functions.
inline vi place_triangles(const Bundle *r, global const Leaf *leaf, float z_far, int of_packet,
                          Placed *p)
{
    p->v = shear_corners(r, leaf);
    p->x = make_axis(r, r->sx, r->tx, r->ox, r->dx, p->v.x, p->v.z);
    p->y = make_axis(r, r->sy, r->ty, r->oy, r->dy, p->v.y, p->v.z);
    const vi keep = ~(beside_rays(&p->x) | beside_rays(&p->y) | GT(least3(p->v.z), (vf)(z_far)));
    if (!row_any(keep)) return keep;
    return keep & place_edges(r, of_packet, p);
}

inline void set_up_triangles(const Bundle *r, global const Leaf *leaf, float z_far, Triangles *out)
{
    Placed p;
    out->keep = 0;
    vi keep = place_triangles(r, leaf, z_far, 0, &p);
    if (!row_any(keep)) return;
    const vi columns = samples_reached(&p.x), rows = samples_reached(&p.y);
    keep &= ~(EQ(columns, (vi)(0)) | EQ(rows, (vi)(0)));
    out->keep = row_bits(keep);
    if (!out->keep) return;
    VSTORE(least3(p.v.z), out->near);
    VSTORE(rows, out->rows);
    VSTORE(columns, out->columns);
    out->covers = row_bits(keep & p.covers);
    out->edge_on = row_bits(keep & p.edge_on);
    for (int k = 0; k < 3; ++k) out->functions[k] = p.edge[k];
    depth_affines(&p.v, r, p.flip, out->functions + NUMERATOR, out->functions + DENOMINATOR);
}
