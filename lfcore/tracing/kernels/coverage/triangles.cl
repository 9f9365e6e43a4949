// Triangles against a block: edge functions and depth, LANES triangles at a time.
//
// In the frame sheared to the block's centre ray, X = x - ox - z dx (Y alike), the edge function of
// p -> q, D . ((p - O) x (q - O)), is affine over the block: the term in O x O vanishes, and so
// does the bilinear one, for lens samples of one pixel as for pixels of one lens sample.  It is
//     e = c_z + i (c_x tx + g_y sx) + j (c_y ty - g_x sy),   c = P x Q,  g = P - Q
// and the code has twice that.  Blocks of several elements add (j u - i v) (sx b - a tx) g_z.
//
// Source of edge functions: J. Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH
// 1988.
#pragma once
#include "packet.cl"

// The edge equation for coverage, interpolation and shadows: 2 P x Q = (P + Q) x (Q - P).  Its
// error scales with the edge, not with the distance to the origin.  Swapping P and Q negates it to
// the last bit.
inline Vec edge_normals(Vec p, Vec q) { return cross3(plus3(p, q), minus3(q, p)); }

// Corners of LANES triangles of a leaf, from `lane` on, relative to `origin`.
inline void load_corners(global const Leaf *leaf, int lane, float3 origin, Vec *v)
{
    for (int k = 0; k < 3; ++k) {
        const Vec p = {VLOAD(leaf->corner[k][0] + lane), VLOAD(leaf->corner[k][1] + lane),
                       VLOAD(leaf->corner[k][2] + lane)};
        v[k] = minus3(p, spread3(origin));
    }
}

// Shear corners to the frame of the block's centre ray.
inline void shear_corners(const Bundle *r, Vec *v)
{
    for (int k = 0; k < 3; ++k) {
        v[k].x = fma(-v[k].z, (vf)(r->dx), v[k].x - r->ox);
        v[k].y = fma(-v[k].z, (vf)(r->dy), v[k].y - r->oy);
    }
}

// Along one axis: the rays' steps s + z t and, from element to element, a + z b; their half extent;
// the triangles' corners at depths z; and a bound of the rounding error of corners and rays.
typedef struct {
    float s, t, a, b, half_extent;
    Triple at, z;
    vf error;
} Axis;

// Along x or, `down`, along y, of corners in the frame of the block's centre ray.
inline Axis make_axis(const Bundle *r, const Vec *v, int down)
{
    const float s = down ? r->sy : r->sx, t = down ? r->ty : r->tx;
    const float o = down ? r->oy : r->ox, d = down ? r->dy : r->dx;
    const float origins = fabs(o) + r->half_extent * fabs(s) + OUTER_HALF * fabs(r->a);
    const float directions = fabs(d) + r->half_extent * fabs(t) + OUTER_HALF * fabs(r->b);
    Triple at, z;
    for (int k = 0; k < 3; ++k) {
        at.corner[k] = down ? v[k].y : v[k].x;
        z.corner[k] = v[k].z;
    }
    const vf most = largest3(at) + fma(largest3(z), (vf)(directions), (vf)(origins));
    return (Axis){.s = s, .t = t, .a = r->a, .b = r->b, .half_extent = r->half_extent,
                  .at = at, .z = z, .error = CORNER_ERROR * most};
}

// Mask of triangles wholly beside the rays, front and back faces.  The half width of the rays is
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

// The first and last column (row, along y) of an element that triangles reach, from its first ray
// on.  The map from a triangle to the grid is projective: if s + z t keeps its sign over the
// triangle (the returned mask), the first and last column belong to corners.
inline vi find_span(const Axis *a, int element, vf *lo, vf *hi)
{
    Triple step, inverse, column;
    for (int k = 0; k < 3; ++k) {
        step.corner[k] = fma(a->z.corner[k], (vf)(a->t), (vf)(a->s));
        inverse.corner[k] = reciprocal(step.corner[k]);
        const vf apart = fma(a->z.corner[k], (vf)(a->b), (vf)(a->a));
        vf at = a->at.corner[k];
        if (OUTER > 1) at = fma((vf)(OUTER_HALF - element), apart, at);
        column.corner[k] = at * inverse.corner[k];
    }
    const vf beyond = a->error * largest3(inverse);
    *lo = least3(column) - beyond + a->half_extent;
    *hi = most3(column) + beyond + a->half_extent;
    return GT(step.corner[0] * step.corner[1], (vf)(0.0f)) &
           GT(step.corner[1] * step.corner[2], (vf)(0.0f));
}

// The block's 16 columns that triangles can reach, a bit each.
inline vi reached_columns(const Axis *a)
{
    vi reached = 0, one_sided = 0;
    for (int element = 0; element < OUTER; ++element) {
        vf lo, hi;
        one_sided = find_span(a, element, &lo, &hi);
        const vi first = TO_VI(clamp(ceil(lo), (vf)(0.0f), (vf)(INNER)));
        const vi end = TO_VI(clamp(floor(hi) + 1.0f, (vf)(0.0f), (vf)(INNER)));
        reached |= max(((vi)(1) << end) - ((vi)(1) << first), (vi)(0)) << (element * INNER);
    }
    return pick_int((vi)((1 << BLOCK) - 1), reached, one_sided);
}

// Twice the edge function from p to q.
inline WideAffine edge_function(const Bundle *r, Vec p, Vec q)
{
    const Vec d = minus3(q, p), c = edge_normals(p, q);
    WideAffine e;
    e.term[ONE] = c.z;
    e.term[X] = fma(c.x, (vf)(r->tx), -2.0f * d.y * r->sx);
    e.term[Y] = fma(c.y, (vf)(r->ty), 2.0f * d.x * r->sy);
    if (OUTER > 1) {
        e.term[U] = fma(c.x, (vf)(r->b), -2.0f * d.y * r->a);
        e.term[V] = fma(c.y, (vf)(r->b), 2.0f * d.x * r->a);
        e.term[BILINEAR] = d.z * (-2.0f * (r->sx * r->b - r->a * r->tx));
    }
    return e;
}

// A bound of the edge function's error at the rays of the block.
inline vf edge_error(const Bundle *r, Vec p, Vec q)
{
    const Vec m = absolute3(plus3(p, q)), l = absolute3(minus3(q, p));
    const vf kx = fma(m.y, l.z, m.z * l.y), ky = fma(m.z, l.x, m.x * l.z);
    const vf inner = fma(kx, (vf)(fabs(r->tx)), 2.0f * l.y * fabs(r->sx)) +
                     fma(ky, (vf)(fabs(r->ty)), 2.0f * l.x * fabs(r->sy));
    vf most = fma((vf)(r->half_extent), inner, fma(m.x, l.y, m.y * l.x));
    if (OUTER > 1) {
        const vf outer = fma(kx + ky, (vf)(fabs(r->b)), 2.0f * (l.x + l.y) * fabs(r->a));
        const float steps = fabs(r->sx * r->b) + fabs(r->a * r->tx);
        const vf bilinear = l.z * (4.0f * r->half_extent * OUTER_HALF * steps);
        most += fma((vf)(OUTER_HALF), outer, bilinear);
    }
    return EDGE_ERROR * most;
}

// The edge functions opposite the corners p, q and r, and their sum, twice n . D.
inline WideAffine edge_functions(const Bundle *r, const Vec *v, WideAffine *edge)
{
    for (int k = 0; k < 3; ++k) edge[k] = edge_function(r, v[(k + 1) % 3], v[(k + 2) % 3]);
    WideAffine sum;
    for (int k = 0; k < AFFINE_TERMS; ++k)
        sum.term[k] = edge[0].term[k] + edge[1].term[k] + edge[2].term[k];
    if (OUTER > 1) sum.term[BILINEAR] = 0.0f;  // the three differences of depth cancel
    return sum;
}

// A bound of an affine function's change from the centre of a block of that half_extent.
inline vf affine_spread(WideAffine e, float half_extent)
{
    vf spread = half_extent * (fabs(e.term[X]) + fabs(e.term[Y]));
    if (OUTER > 1)
        spread += OUTER_HALF * (fabs(e.term[U]) + fabs(e.term[V])) +
                  2.0f * half_extent * OUTER_HALF * fabs(e.term[BILINEAR]);
    return spread;
}

// Functions of a triangle: edges opposite p, q and r, and depth's.
enum { NUMERATOR = 3, DENOMINATOR, FUNCTIONS };

// LANES triangles of a leaf against a block's rays; only those in `keep` are set up to the end.
typedef struct {
    Vec v[3];                         // corners, sheared
    Axis x, y;
    vi flip;                          // sign bit if seen from behind
    uint keep;                        // lanes that may be hit
    uint edge_on;                     // lanes edge-on to some ray: n . D changes its sign
    float near[LANES], far[LANES];    // least and greatest depth of each
    float slack[LANES];               // error bound of the edge functions if edge-on
    int rows[LANES];                  // a bit per row that each can reach
    int columns[LANES];               // and columns
    WideAffine functions[FUNCTIONS];  // signed so that n . D > 0 unless edge-on
} Triangles;

// Edges signed so that n . D > 0 unless the triangle is seen edge-on, and widened by their errors.
// Returns the mask of triangles that some ray may hit.
inline vi set_up_edges(const Bundle *r, const vf *error, Triangles *out)
{
    WideAffine *e = out->functions;
    const WideAffine sum = edge_functions(r, out->v, e);
    const vf centre = sum.term[ONE], change = affine_spread(sum, r->half_extent);
    const vi flat = EQ(centre, (vf)(0.0f)) & EQ(change, (vf)(0.0f));
    const vi edge_on = LE(fabs(centre), change * BOUND_SLACK);
    vi outside = 0;
    out->flip = LT(centre, (vf)(0.0f)) & ~edge_on & (vi)(0x80000000);
    for (int k = 0; k < 3; ++k) {
        for (int term = 0; term < AFFINE_TERMS; ++term)
            e[k].term[term] = flip_sign(e[k].term[term], out->flip);
        e[k].term[ONE] += pick((vf)(0.0f), error[k], ~edge_on);
        const vf c = e[k].term[ONE], spread = affine_spread(e[k], r->half_extent) * BOUND_SLACK;
        outside |= LT(c + spread, (vf)(-NOTHING_LEFT));
    }
    VSTORE(pick((vf)(0.0f), max(error[0], max(error[1], error[2])), edge_on), out->slack);
    out->edge_on = row_bits(edge_on);
    return ~(flat | (outside & ~edge_on));
}

// The affine function one + x * step_x * column + y * step_y * row; over elements with `outer`.
inline WideAffine stepped_affine(vf one, vf x, vf y, float step_x, float step_y, float outer)
{
    WideAffine f;
    f.term[ONE] = one;
    f.term[X] = x * step_x;
    f.term[Y] = y * step_y;
    if (OUTER > 1) {
        f.term[U] = x * outer;
        f.term[V] = y * outer;
        f.term[BILINEAR] = 0.0f;
    }
    return f;
}

// Depth from the plane n . X = n . P, whose error scales with the triangle, not with its distance.
inline void depth_functions(const Bundle *r, const Vec *v, vi flip, WideAffine *numerator,
                            WideAffine *denominator)
{
    const Vec n = turn_vectors(geometric_normals(v), flip);
    *numerator = stepped_affine(dot3(n, v[0]), -n.x, -n.y, r->sx, r->sy, r->a);
    *denominator = stepped_affine(n.z, n.x, n.y, r->tx, r->ty, r->b);
}

// The function of one of LANES triangles.
inline Affine affine_of(const WideAffine *f, uint lane)
{
    Affine g;
    for (int k = 0; k < AFFINE_TERMS; ++k) g.term[k] = ((const float *)(f->term + k))[lane];
    return g;
}

// Mask of triangles whose bounding boxes overlap the block, even if only between its rays.
inline vi set_up_axes(const Bundle *r, global const Leaf *leaf, int lane, float z_far,
                      Triangles *out)
{
    Vec *v = out->v;
    load_corners(leaf, lane, 0.0f, v);
    shear_corners(r, v);
    out->x = make_axis(r, v, 0);
    out->y = make_axis(r, v, 1);
    const vf near = least3(out->x.z);
    VSTORE(near, out->near);
    VSTORE(most3(out->x.z), out->far);
    return ~(beside_rays(&out->x) | beside_rays(&out->y) | GT(near, (vf)(z_far)));
}

inline void set_up_triangles(const Bundle *r, global const Leaf *leaf, int lane, float z_far,
                             Triangles *out)
{
    const Vec *v = out->v;
    vf error[3];
    out->keep = 0;
    vi keep = set_up_axes(r, leaf, lane, z_far, out);
    if (!row_any(keep)) return;
    for (int k = 0; k < 3; ++k) error[k] = edge_error(r, v[(k + 1) % 3], v[(k + 2) % 3]);
    keep &= set_up_edges(r, error, out);
    if (!row_any(keep)) return;
    const vi columns = reached_columns(&out->x), rows = reached_columns(&out->y);
    out->keep = row_bits(keep & ~(EQ(columns, (vi)(0)) | EQ(rows, (vi)(0))));
    if (!out->keep) return;
    VSTORE(rows, out->rows);
    VSTORE(columns, out->columns);
    depth_functions(r, v, out->flip, out->functions + NUMERATOR, out->functions + DENOMINATOR);
}
