// Triangles against a block: edge functions and the planes of triangles, set up LANES at a time.
//
// In the frame sheared to the block's centre ray, X = x - ox - z dx (Y alike), the edge function of
// p -> q, D . ((p - O) x (q - O)), is affine over the block: the term in O x O vanishes, and so
// does the bilinear one, for lens samples of one pixel as for pixels of one lens sample.  It is
//     e = c_z + i (c_x tx + g_y sx) + j (c_y ty - g_x sy),   c = P x Q,  g = P - Q
// of which twice is kept.  Blocks of several elements add the term (y u - x v) (sx b - a tx) g_z.
// Depth is that of the triangle's plane, n . X = n . P.
//
// Source of edge functions: J. Pineda, "A Parallel Algorithm for Polygon Rasterization", SIGGRAPH
// 1988.
#ifndef LFCORE_TRIANGLES_CL
#define LFCORE_TRIANGLES_CL
#include "packet.cl"

// Rows of LANES coefficients: the edges opposite p, q and r, and depth's numerator and denominator.
#define NUMERATOR_ROW (3 * EDGE_TERMS)
#define DENOMINATOR_ROW (NUMERATOR_ROW + PLANE_TERMS)
#define COEFFICIENTS (DENOMINATOR_ROW + PLANE_TERMS)
typedef struct { float row[OUTER > 1 ? 28 : 15][LANES]; } Coefficients;

inline Form edge_of(const Coefficients *c, int edge, uint lane)
{
    Form f;
    for (int k = 0; k < EDGE_TERMS; ++k) f.of[k] = c->row[edge * EDGE_TERMS + k][lane];
    return f;
}
inline Form plane_of(const Coefficients *c, int row, uint lane)
{
    Form f;
    for (int k = 0; k < PLANE_TERMS; ++k) f.of[k] = c->row[row + k][lane];
    if (OUTER > 1) f.of[TWIST] = 0.0f;
    return f;
}
inline void store_forms(const Forms *f, int terms, int row, Coefficients *c)
{
    for (int k = 0; k < terms; ++k) VSTORE(f->of[k], c->row[row + k]);
}

inline Forms flip_forms(Forms f, vi sign)
{
    for (int k = 0; k < EDGE_TERMS; ++k) f.of[k] = flip_sign(f.of[k], sign);
    return f;
}

// Along one axis, corners p, q and r of LANES triangles.
typedef struct { vf p, q, r; } Triple;
inline vf least3(Triple a) { return min(a.p, min(a.q, a.r)); }
inline vf most3(Triple a) { return max(a.p, max(a.q, a.r)); }
inline Triple absolute3(Triple a)
{
    const Triple b = {fabs(a.p), fabs(a.q), fabs(a.r)};
    return b;
}

// Corners of LANES triangles in the frame of the block's centre ray.
typedef struct { Triple x, y, z; } Corners;

inline vf sheared(global const float *leaf, int row, float origin, float direction, vf z)
{
    return fma(-z, direction, VLOAD(leaf + row * NODE_WIDTH) - origin);
}

inline Corners shear_corners(const Bundle *r, global const float *leaf)
{
    Corners c;
    c.z.p = VLOAD(leaf + 2 * NODE_WIDTH);
    c.z.q = VLOAD(leaf + 5 * NODE_WIDTH);
    c.z.r = VLOAD(leaf + 8 * NODE_WIDTH);
    c.x.p = sheared(leaf, 0, r->ox, r->dx, c.z.p);
    c.x.q = sheared(leaf, 3, r->ox, r->dx, c.z.q);
    c.x.r = sheared(leaf, 6, r->ox, r->dx, c.z.r);
    c.y.p = sheared(leaf, 1, r->oy, r->dy, c.z.p);
    c.y.q = sheared(leaf, 4, r->oy, r->dy, c.z.q);
    c.y.r = sheared(leaf, 7, r->oy, r->dy, c.z.r);
    return c;
}

// One corner of each.
inline Vec corner_p(const Corners *c) { const Vec v = {c->x.p, c->y.p, c->z.p}; return v; }
inline Vec corner_q(const Corners *c) { const Vec v = {c->x.q, c->y.q, c->z.q}; return v; }
inline Vec corner_r(const Corners *c) { const Vec v = {c->x.r, c->y.r, c->z.r}; return v; }

// The bounds of rounding errors below, in roundings of the terms that enter: sum, difference,
// product and their difference are four of each term, evaluation at a ray two more, or four with u
// and v.
#define EDGE_NOISE ((OUTER > 1 ? 8.06f : 6.05f) * ROUNDING)

// Twice the edge function from p to q: P x Q = (P + Q) x (Q - P) / 2.  The difference of two
// corners that are near each other is exact, so the error scales with the triangle's edge, and not
// with the distance to the block's centre as that of P x Q does; swapping P and Q negates it to the
// last bit all the same.  `noise` receives a bound of its error anywhere in the block.
inline Forms edge_forms(Vec p, Vec q, const Bundle *r, vf *noise)
{
    const vf sx = p.x + q.x, sy = p.y + q.y, sz = p.z + q.z;
    const vf dx = q.x - p.x, dy = q.y - p.y, dz = q.z - p.z;
    const vf cx = sy * dz - sz * dy, cy = sz * dx - sx * dz;
    Forms e;
    e.of[ONE] = sx * dy - sy * dx;
    e.of[X] = fma(cx, (vf)(r->tx), -2.0f * dy * r->sx);
    e.of[Y] = fma(cy, (vf)(r->ty), 2.0f * dx * r->sy);
    const vf mx = fabs(sx), my = fabs(sy), mz = fabs(sz), ex = fabs(dx), ey = fabs(dy);
    const vf ez = fabs(dz);
    const vf kx = fma(my, ez, mz * ey), ky = fma(mz, ex, mx * ez);
    const vf wide = fma(kx, (vf)(fabs(r->tx)), 2.0f * ey * fabs(r->sx)) +
                    fma(ky, (vf)(fabs(r->ty)), 2.0f * ex * fabs(r->sy));
    vf most = fma((vf)(HALF), wide, fma(mx, ey, my * ex));
    if (OUTER > 1) {
        e.of[U] = fma(cx, (vf)(r->b), -2.0f * dy * r->a);
        e.of[V] = fma(cy, (vf)(r->b), 2.0f * dx * r->a);
        e.of[TWIST] = dz * (-2.0f * (r->sx * r->b - r->a * r->tx));
        const vf outer = fma(kx + ky, (vf)(fabs(r->b)), 2.0f * (ex + ey) * fabs(r->a));
        const float steps = fabs(r->sx * r->b) + fabs(r->a * r->tx);
        const vf twist = ez * (4.0f * HALF * OUTER_HALF * steps);
        most += fma((vf)(OUTER_HALF), outer, twist);
    }
    *noise = EDGE_NOISE * most;
    return e;
}

// What a form varies by within the block, at most.
inline vf form_spread(Forms e)
{
    vf wide = HALF * (fabs(e.of[X]) + fabs(e.of[Y]));
    if (OUTER > 1)
        wide += OUTER_HALF * (fabs(e.of[U]) + fabs(e.of[V])) +
                2.0f * HALF * OUTER_HALF * fabs(e.of[TWIST]);
    return wide;
}

// The edges of LANES triangles opposite p, q and r, and how they lie to all the rays of the block.
typedef struct {
    Forms edge[3];
    vi meets;    // some ray may meet it
    vi covers;   // every ray does
    vi edge_on;  // some ray sees it edge-on: the sign of n . D changes
    vi flip;     // sign bit of those that were seen from behind
} Edges;

// Edges signed so that n . D > 0 unless the triangle is seen edge-on, and then widened by their
// noise.
inline Edges make_edges(const Corners *v, const Bundle *r)
{
    const Vec p = corner_p(v), q = corner_q(v), w = corner_r(v);
    Edges e;
    vf noise[3];
    e.edge[0] = edge_forms(q, w, r, noise);
    e.edge[1] = edge_forms(w, p, r, noise + 1);
    e.edge[2] = edge_forms(p, q, r, noise + 2);
    Forms sum;  // n . D
    for (int k = 0; k < EDGE_TERMS; ++k)
        sum.of[k] = e.edge[0].of[k] + e.edge[1].of[k] + e.edge[2].of[k];
    if (OUTER > 1) sum.of[TWIST] = 0.0f;  // the three differences of depth cancel
    const vf middle = sum.of[ONE], wide = form_spread(sum);
    const vi flat = EQ(middle, (vf)(0.0f)) & EQ(wide, (vf)(0.0f));
    e.edge_on = LE(fabs(middle), wide * BOUND_SLACK);
    e.flip = LT(middle, (vf)(0.0f)) & ~e.edge_on & (vi)(0x80000000);
    vi outside = 0;
    e.covers = ~e.edge_on;
    for (int k = 0; k < 3; ++k) {
        e.edge[k] = flip_forms(e.edge[k], e.flip);
        e.edge[k].of[ONE] += pick((vf)(0.0f), noise[k], ~e.edge_on);
        const vf c = e.edge[k].of[ONE], spread = form_spread(e.edge[k]) * BOUND_SLACK;
        outside |= LT(c + spread, (vf)(-NOTHING_LEFT));
        e.covers &= GE(c, spread + NOTHING_LEFT);
    }
    e.meets = ~(flat | (outside & ~e.edge_on));
    return e;
}

// Depth from the plane n . X = n . P: n is made of edges, so its error scales with the triangle and
// not with its distance, as that of the weighted mean of corners does.
inline void plane_forms(const Corners *v, const Bundle *r, vi flip, Coefficients *out)
{
    const vf ax = v->x.q - v->x.p, ay = v->y.q - v->y.p, az = v->z.q - v->z.p;
    const vf bx = v->x.r - v->x.p, by = v->y.r - v->y.p, bz = v->z.r - v->z.p;
    const vf nx = flip_sign(ay * bz - az * by, flip), ny = flip_sign(az * bx - ax * bz, flip);
    const vf nz = flip_sign(ax * by - ay * bx, flip);
    Forms over, under;
    over.of[ONE] = fma(nx, v->x.p, fma(ny, v->y.p, nz * v->z.p));
    over.of[X] = -nx * r->sx;
    over.of[Y] = -ny * r->sy;
    under.of[ONE] = nz;
    under.of[X] = nx * r->tx;
    under.of[Y] = ny * r->ty;
    if (OUTER > 1) {
        over.of[U] = -nx * r->a;
        over.of[V] = -ny * r->a;
        under.of[U] = nx * r->b;
        under.of[V] = ny * r->b;
    }
    store_forms(&over, PLANE_TERMS, NUMERATOR_ROW, out);
    store_forms(&under, PLANE_TERMS, DENOMINATOR_ROW, out);
}

// Along one axis: the rays' steps s + z t and centre direction d, and the triangles' corners at
// depths z.
typedef struct { float s, t, d; const Bundle *rays; Triple at, z; } Axis;

// Seven roundings: of corners sheared, and of where the block's rays pass them.
#define CORNER_NOISE (6.72f * ROUNDING)

// Bound of the rounding error of sheared corners and of the rays beside them.
inline vf corner_noise(const Axis *a)
{
    const float origins = HALF * fabs(a->s) + OUTER_HALF * fabs(a->rays->a);
    const float directions = fabs(a->d) + HALF * fabs(a->t) + OUTER_HALF * fabs(a->rays->b);
    const vf z_most = max(fabs(least3(a->z)), fabs(most3(a->z)));
    const vf most = most3(absolute3(a->at));
    return CORNER_NOISE * (most + fma(z_most, (vf)(directions), (vf)(origins)));
}

// Half of what the block's rays span at depth z, with slack for two roundings of it.
inline vf rays_half(const Axis *a, vf z)
{
    const vf inner = HALF * fabs(fma(z, (vf)(a->t), (vf)(a->s)));
    if (OUTER == 1) return inner;
    return inner + OUTER_HALF * fabs(fma(z, (vf)(a->rays->b), (vf)(a->rays->a)));
}

// Mask of triangles that lie wholly beside the rays, whichever way they face: what the rays span is
// convex in z.
inline vi beside_rays(const Axis *a, vf noise)
{
    const vf wide = max(rays_half(a, least3(a->z)), rays_half(a, most3(a->z)));
    const vf limit = fma(wide, (vf)(BOUND_SLACK), noise);
    return GT(least3(a->at), limit) | LT(most3(a->at), -limit);
}

// A hundredth of a sample is far more than the rounding of where corners fall among samples.
#define SAMPLE_SLACK 0.01f

// The block's 16 columns (rows, along y) that triangles can reach, a bit each.  At depth z
// neighbouring rays of the inner grid are s + z t apart, and those of neighbouring elements a + z
// b; for each element the extremes are the corners' as long as the former keeps its sign over the
// triangle, since the map is projective.
inline vi samples_reached(const Axis *a, vf noise)
{
    const Bundle *r = a->rays;
    const vf wp = fma(a->z.p, (vf)(a->t), (vf)(a->s)), wq = fma(a->z.q, (vf)(a->t), (vf)(a->s));
    const vf wr = fma(a->z.r, (vf)(a->t), (vf)(a->s));
    const vf ip = reciprocal(wp), iq = reciprocal(wq), ir = reciprocal(wr);
    const vf slack = fma(noise, max(fabs(ip), max(fabs(iq), fabs(ir))), (vf)(SAMPLE_SLACK));
    vi reached = 0;
    for (int k = 0; k < OUTER; ++k) {
        Triple at = a->at;
        if (OUTER > 1) {
            const vf u = OUTER_HALF - k;
            at.p = fma(u, fma(a->z.p, (vf)(r->b), (vf)(r->a)), at.p);
            at.q = fma(u, fma(a->z.q, (vf)(r->b), (vf)(r->a)), at.q);
            at.r = fma(u, fma(a->z.r, (vf)(r->b), (vf)(r->a)), at.r);
        }
        const Triple sample = {at.p * ip, at.q * iq, at.r * ir};
        const vf lo = ceil(least3(sample) - slack + HALF);
        const vf hi = floor(most3(sample) + slack + (HALF + 1.0f));
        const vi first = TO_VI(clamp(lo, (vf)(0.0f), (vf)(INNER)));
        const vi end = TO_VI(clamp(hi, (vf)(0.0f), (vf)(INNER)));
        reached |= max(((vi)(1) << end) - ((vi)(1) << first), (vi)(0)) << (k * INNER);
    }
    const vi one_sided = GT(wp * wq, (vf)(0.0f)) & GT(wq * wr, (vf)(0.0f));
    return pick_int((vi)((1 << BLOCK) - 1), reached, one_sided);
}

// LANES triangles set up for a block, as far as they may be hit.
typedef struct {
    uint keep;                    // lanes that may be hit
    uint covers;                  // of those, lanes that every ray of the block is inside of
    uint edge_on;                 // lanes that some ray sees edge-on
    float near[LANES];            // where each begins
    int rows[LANES];              // rows that each can touch, a bit each
    int columns[LANES];           // and columns
    Coefficients coefficients;    // signed so that n . D > 0 unless edge-on
} Triangles;

// LANES triangles of a leaf among the rays of a block.
typedef struct {
    Corners v;
    Axis x, y;
    vf noise_x, noise_y;
    Edges edges;
} Placed;

// Mask of those that rays anywhere in the block may meet, between its samples, too.
inline vi place_triangles(const Bundle *r, global const float *leaf, float z_far, Placed *p)
{
    p->v = shear_corners(r, leaf);
    const Axis x = {r->sx, r->tx, r->dx, r, p->v.x, p->v.z};
    const Axis y = {r->sy, r->ty, r->dy, r, p->v.y, p->v.z};
    p->x = x;
    p->y = y;
    p->noise_x = corner_noise(&x);
    p->noise_y = corner_noise(&y);
    const vi keep = ~(beside_rays(&x, p->noise_x) | beside_rays(&y, p->noise_y) |
                      GT(least3(p->v.z), (vf)(z_far)));
    if (!row_any(keep)) return keep;
    p->edges = make_edges(&p->v, r);
    return keep & p->edges.meets;
}

// Set up the LANES triangles of a leaf.
inline void set_up_triangles(const Bundle *r, global const float *leaf, float z_far, Triangles *out)
{
    Placed p;
    out->keep = 0;
    vi keep = place_triangles(r, leaf, z_far, &p);
    if (!row_any(keep)) return;
    const vi columns = samples_reached(&p.x, p.noise_x), rows = samples_reached(&p.y, p.noise_y);
    keep &= ~(EQ(columns, (vi)(0)) | EQ(rows, (vi)(0)));
    out->keep = row_bits(keep);
    if (!out->keep) return;
    VSTORE(least3(p.v.z), out->near);
    VSTORE(rows, out->rows);
    VSTORE(columns, out->columns);
    out->covers = row_bits(keep & p.edges.covers);
    out->edge_on = row_bits(keep & p.edges.edge_on);
    for (int k = 0; k < 3; ++k)
        store_forms(p.edges.edge + k, EDGE_TERMS, k * EDGE_TERMS, &out->coefficients);
    plane_forms(&p.v, r, p.edges.flip, &out->coefficients);
}

#endif
