// Shadows: which rays of a block cannot see a light.
//
// All shadow rays of a block share the light as apex (or a direction), so a triangle is set up once
// per block and light: inside its three edge planes and beyond its own plane is dark.  Four affine
// forms of the hit point decide that, relative to the light; hit points never leave that frame, and
// what is excluded near the surface is relative to the numbers that enter, not an absolute length.
#ifndef LFCORE_SHADOWS_CL
#define LFCORE_SHADOWS_CL
#include "shading.cl"

#if SHADOW_LIGHTS
#include "shaft.cl"

#define SHADOW_LIST 512
#define SHADOW_FORMS 16
#define SPAN 1.1f
// 16 roundings of the numbers that enter: a hit point is off its plane by a few.  Against the float64 oracle,
// half of this darkens some rays beside a neighbouring triangle, four times it loses contact shadows.
#define SHADOW_MARGIN 1.0e-6f

// Apex and extent of a block's shadow rays.
typedef struct {
    int is_point;
    float3 apex;           // the light, or the middle of the hit points
    float3 towards;        // direction to a directional light
    float3 centre, extent; // box of the hit points relative to the apex
    float3 size;           // largest magnitudes that entered, for the margin
} ShadowRays;

// Boxes of the hit points of four bands of four rows: lows and highs by axis, in camera space.
typedef struct { float4 lo[3], hi[3]; } Bands;

// A form n . P + c of the hit point relative to the apex.
typedef struct { Vec n; vf c; } Plane;

inline vf plane_reach(Plane f, const ShadowRays *r)
{
    const vf middle = fma(f.n.x, (vf)(r->centre.x), fma(f.n.y, (vf)(r->centre.y), fma(f.n.z, (vf)(r->centre.z), f.c)));
    const vf spread = fma(fabs(f.n.x), (vf)(r->extent.x), fma(fabs(f.n.y), (vf)(r->extent.y), fabs(f.n.z) * r->extent.z));
    const vf noise = fma(fabs(f.n.x), (vf)(r->size.x), fma(fabs(f.n.y), (vf)(r->size.y), fma(fabs(f.n.z), (vf)(r->size.z), fabs(f.c))));
    return middle + 1.00001f * spread + 1.0e-6f * noise;
}

inline Plane flip_plane(Plane f, vi sign)
{
    FLIP_BY(f.n.x, sign); FLIP_BY(f.n.y, sign); FLIP_BY(f.n.z, sign); FLIP_BY(f.c, sign);
    return f;
}

// The four forms of LANES triangles: a ray is dark where the three edges are not negative and the
// last, beyond the triangle's plane, is positive.  Returns the mask of those that may darken the block.
inline vi setup_occluders(const ShadowRays *r, const Shaft *shaft, global const float *leaf, Plane *out)
{
    const vi near = ~shaft_misses(shaft, leaf);
    if (!row_any(near)) return near;
    Vec v[3];
    for (int k = 0; k < 3; ++k) {
        v[k].x = VLOAD(leaf + 48 * k) - r->apex.x;
        v[k].y = VLOAD(leaf + 48 * k + 16) - r->apex.y;
        v[k].z = VLOAD(leaf + 48 * k + 32) - r->apex.z;
    }
    const Vec a = {v[1].x - v[0].x, v[1].y - v[0].y, v[1].z - v[0].z}, b = {v[2].x - v[0].x, v[2].y - v[0].y, v[2].z - v[0].z};
    const Vec n = {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    const Vec to = {(vf)(r->towards.x), (vf)(r->towards.y), (vf)(r->towards.z)};
    const vf offset = dot3(n, v[0]);
    // Oriented by the side that the light is on; a triangle seen edge-on casts no shadow.
    const vf side = r->is_point ? offset : dot3(n, to);
    const vi flip = AS_VI(side) & (vi)(0x80000000);
    const vf margin = SHADOW_MARGIN * fma(fabs(n.x), fabs(v[0].x) + r->size.x,
                                    fma(fabs(n.y), fabs(v[0].y) + r->size.y, fabs(n.z) * (fabs(v[0].z) + r->size.z)));
    const Plane plane = {n, -offset};
    out[3] = flip_plane(plane, r->is_point ? flip : flip ^ (vi)(0x80000000));
    out[3].c -= margin;
    vi keep = near & ~EQ(side, (vf)(0.0f)) & GE(plane_reach(out[3], r), (vf)(0.0f));
    if (!row_any(keep)) return keep;
    for (int k = 0; k < 3; ++k) {
        const Vec q = v[(k + 1) % 3], w = v[(k + 2) % 3];
        const Vec c = {q.y * w.z - q.z * w.y, q.z * w.x - q.x * w.z, q.x * w.y - q.y * w.x};
        Plane edge = {c, 0.0f};
        if (!r->is_point) {
            const Vec d = {w.x - q.x, w.y - q.y, w.z - q.z};
            const Vec along = {to.y * d.z - to.z * d.y, to.z * d.x - to.x * d.z, to.x * d.y - to.y * d.x};
            edge.n = along;
            edge.c = dot3(to, c);
        }
        out[k] = flip_plane(edge, flip);
        keep &= GE(plane_reach(out[k], r), (vf)(0.0f));
    }
    return keep;
}

// A block on one triangle: the hit point times the denominator of depth is affine over the block (rays
// of a pixel meet in its focus point, rays of a view in the lens sample: a homography either way), so
// the occluders' forms are too, and are tested like triangles in triangles.cl.
typedef struct {
    float3 c, i, j;     // (P - apex) * weight
    float wc, wi, wj;   // weight, positive over the block
} Receiver;

inline Receiver make_receiver(const Bundle *r, const float *depth, float3 apex)
{
    const float zc = depth[0], zi = depth[1], zj = depth[2], wc = depth[3], wi = depth[4], wj = depth[5];
    Receiver f = {(float3)(r->ox * wc + zc * r->dx, r->oy * wc + zc * r->dy, zc) - apex * wc,
                  (float3)(r->sx * wc + r->ox * wi + zi * r->dx + zc * r->tx, r->oy * wi + zi * r->dy, zi) - apex * wi,
                  (float3)(r->ox * wj + zj * r->dx, r->sy * wc + r->oy * wj + zj * r->dy + zc * r->ty, zj) - apex * wj,
                  wc, wi, wj};
    return f;
}

inline Affine project_plane(const Receiver *f, Plane p)
{
    Affine e;
    e.c = fma(p.n.x, (vf)(f->c.x), fma(p.n.y, (vf)(f->c.y), fma(p.n.z, (vf)(f->c.z), p.c * f->wc)));
    e.i = fma(p.n.x, (vf)(f->i.x), fma(p.n.y, (vf)(f->i.y), fma(p.n.z, (vf)(f->i.z), p.c * f->wi)));
    e.j = fma(p.n.x, (vf)(f->j.x), fma(p.n.y, (vf)(f->j.y), fma(p.n.z, (vf)(f->j.z), p.c * f->wj)));
    return e;
}

// Receivers of a block of several triangles: one of each, as if it filled the block.
#define RECEIVERS 8
typedef struct {
    Receiver of[RECEIVERS];
    int count;          // 0 where they are too many, or one is seen edge-on
} Receivers;

inline void make_receivers(const Bundle *r, const Facets *facets, float3 apex, Receivers *out)
{
    out->count = 0;
    if (facets->lost) return;
    for (int k = 0; k < SLOTS; ++k) {
        if (facets->id[k] < 0) continue;
        if (out->count == RECEIVERS || !one_sided(facets->facet + k)) {
            out->count = 0;
            return;
        }
        out->of[out->count++] = make_receiver(r, facets->facet[k].depth, apex);
    }
}

// Mask of the LANES occluders in `may` that can darken one of the receivers.  What a hit point is off its plane is
// a fraction of SHADOW_MARGIN; half of that keeps whatever could darken a ray, and drops neighbours in one plane.
inline vi darkens_some(const Receivers *receivers, const ShadowRays *r, const Plane *planes, vi may)
{
    vf noise[4];
    for (int k = 0; k < 4; ++k) {
        const Plane f = planes[k];
        noise[k] = 0.5f * SHADOW_MARGIN * fma(fabs(f.n.x), (vf)(r->size.x), fma(fabs(f.n.y), (vf)(r->size.y), fma(fabs(f.n.z), (vf)(r->size.z), fabs(f.c))));
    }
    vi some = 0;
    for (int k = 0; k < receivers->count; ++k) {
        const Receiver *f = receivers->of + k;
        const float most = f->wc + HALF * (fabs(f->wi) + fabs(f->wj));
        vi darkens = may;
        for (int edge = 3; edge >= 0; --edge) {
            const Affine e = project_plane(f, planes[edge]);
            darkens &= GE(e.c + fma(noise[edge], (vf)(most), spread(e)), (vf)(0.0f));
            if (!row_any(darkens)) break;
        }
        some |= darkens;
    }
    return some;
}

// Affine forms of LANES occluders over a receiver's block, and the rows each can darken.
inline uint project_occluders(const Receiver *f, const Plane *planes, vi may, private float *out, private int *rows)
{
    vf first = 0.0f, last = 2.0f * HALF;
    for (int k = 0; k < 4; ++k) {
        const Affine e = project_plane(f, planes[k]);
        may &= GE(e.c + spread(e), (vf)(0.0f));
        narrow_rows(e, (vi)(0), &first, &last);
        VSTORE(e.c, out + 3 * k * LANES);
        VSTORE(e.i, out + (3 * k + 1) * LANES);
        VSTORE(e.j, out + (3 * k + 2) * LANES);
    }
    store_rows(first, last, rows);
    return row_bits(may);
}

// Darken the rays of a receiver's block behind one occluder; false when none is left.
inline int cast_on_facet(private const float *f, uint lane, int first, int last, global int *wants)
{
    float c[12];
    for (int k = 0; k < 12; ++k) c[k] = f[k * LANES + lane];
    for (int row = first; row <= last; ++row) {
        const float y = row - HALF;
        for (int column = 0; column < BLOCK; column += LANES) {
            const vf x = IOTA + (column - HALF);
            const vf a = affine_row(c[0], c[1], c[2], x, y), b = affine_row(c[3], c[4], c[5], x, y);
            const vf g = affine_row(c[6], c[7], c[8], x, y), beyond = affine_row(c[9], c[10], c[11], x, y);
            const vi dark = GE(min(a, min(b, g)), (vf)(0.0f)) & GT(beyond, (vf)(0.0f));
            global int *want = wants + row * BLOCK + column;
            if (row_any(dark)) VSTORE(VLOAD(want) & ~dark, want);
        }
    }
    vi left = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) left |= VLOAD(wants + at);
    return row_any(left);
}

inline uint store_occluders(const Plane *planes, vi may, private float *out)
{
    for (int k = 0; k < 4; ++k) {
        VSTORE(planes[k].n.x, out + (4 * k) * LANES);
        VSTORE(planes[k].n.y, out + (4 * k + 1) * LANES);
        VSTORE(planes[k].n.z, out + (4 * k + 2) * LANES);
        VSTORE(planes[k].c, out + (4 * k + 3) * LANES);
    }
    return row_bits(may);
}

// Darken the rays of a block of several triangles, but for those on the occluder itself.
inline int cast_shadow(const ShadowRays *r, const Bands *bands, private const float *f, uint lane, int id, global const int *ids,
                       global const float *point, global int *wants)
{
    float c[SHADOW_FORMS];
    for (int k = 0; k < SHADOW_FORMS; ++k) c[k] = f[k * LANES + lane];
    // Bands that all four forms may reach; the noise of plane_reach was allowed for the whole block.
    int4 reach = -1;
    for (int k = 0; k < 4; ++k) {
        float4 most = c[4 * k + 3];
        for (int axis = 0; axis < 3; ++axis) {
            const float n = c[4 * k + axis], apex = axis == 0 ? r->apex.x : axis == 1 ? r->apex.y : r->apex.z;
            most += n * ((n > 0.0f ? bands->hi[axis] : bands->lo[axis]) - apex);
        }
        const float noise = 2.0e-6f * (fabs(c[4 * k]) * r->size.x + fabs(c[4 * k + 1]) * r->size.y + fabs(c[4 * k + 2]) * r->size.z + fabs(c[4 * k + 3]));
        reach &= most >= -noise;
    }
    for (int band = 0; band < 4; ++band) {
        if (!((private int *)&reach)[band]) continue;
        for (int at = band * BLOCK_RAYS / 4; at < (band + 1) * BLOCK_RAYS / 4; at += LANES) {
            const vi open = VLOAD(wants + at);
            if (!row_any(open)) continue;
            const vf x = VLOAD(point + at) - r->apex.x, y = VLOAD(point + BLOCK_RAYS + at) - r->apex.y, z = VLOAD(point + 2 * BLOCK_RAYS + at) - r->apex.z;
            const vf e0 = fma(x, (vf)(c[0]), fma(y, (vf)(c[1]), fma(z, (vf)(c[2]), (vf)(c[3]))));
            const vf e1 = fma(x, (vf)(c[4]), fma(y, (vf)(c[5]), fma(z, (vf)(c[6]), (vf)(c[7]))));
            const vf e2 = fma(x, (vf)(c[8]), fma(y, (vf)(c[9]), fma(z, (vf)(c[10]), (vf)(c[11]))));
            const vf beyond = fma(x, (vf)(c[12]), fma(y, (vf)(c[13]), fma(z, (vf)(c[14]), (vf)(c[15]))));
            const vi dark = GE(min(e0, min(e1, e2)), (vf)(0.0f)) & GT(beyond, (vf)(0.0f)) & ~EQ(VLOAD(ids + at), (vi)(id));
            if (row_any(dark)) VSTORE(open & ~dark, wants + at);
        }
    }
    vi left = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) left |= VLOAD(wants + at);
    return row_any(left);
}

// Hit points that want a light and lie within a span of depths: moves them from `wants` to `open`, and
// bounds them.  A block that sees a near thing before a far one would otherwise span all that lies
// between; the span starts at the nearest of what is left.  Returns false when nothing is left.
inline int next_span(const Bundle *r, global const float *point, global int *wants, global int *open, float *lo, float *hi,
                     Bands *bands)
{
    global const float *z = point + 2 * BLOCK_RAYS;
    vf nearest = FAR;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) nearest = pick(nearest, min(nearest, VLOAD(z + at)), VLOAD(wants + at));
    const float from = row_min(nearest);
    if (from >= FAR) return 0;
    const float footprint = BLOCK * max(fabs(fma(from, r->tx, r->sx)), fabs(fma(from, r->ty, r->sy)));
    const float until = fma(from, SPAN, 2.0f * footprint);
    for (int k = 0; k < 3; ++k) { lo[k] = FAR; hi[k] = -FAR; }
    for (int band = 0; band < 4; ++band) {
        vf low[3], high[3];
        vi some = 0;
        for (int k = 0; k < 3; ++k) { low[k] = FAR; high[k] = -FAR; }
        for (int at = band * BLOCK_RAYS / 4; at < (band + 1) * BLOCK_RAYS / 4; at += LANES) {
            const vi want = VLOAD(wants + at), within = want & LE(VLOAD(z + at), (vf)(until));
            VSTORE(within, open + at);
            VSTORE(want & ~within, wants + at);
            some |= within;
            for (int k = 0; k < 3; ++k) {
                const vf x = VLOAD(point + k * BLOCK_RAYS + at);
                low[k] = pick(low[k], min(low[k], x), within);
                high[k] = pick(high[k], max(high[k], x), within);
            }
        }
        const int any_in_band = row_any(some);
        for (int k = 0; k < 3; ++k) {
            const float l = any_in_band ? row_min(low[k]) : FAR, h = any_in_band ? row_max(high[k]) : -FAR;
            ((private float *)&bands->lo[k])[band] = l;
            ((private float *)&bands->hi[k])[band] = h;
            lo[k] = min(lo[k], l);
            hi[k] = max(hi[k], h);
        }
    }
    return 1;
}

inline ShadowRays shadow_rays(global const float *light, const float *lo, const float *hi)
{
    ShadowRays r;
    const float3 low = vload3(0, lo), high = vload3(0, hi), l = vload3(0, light);
    r.is_point = IS_POINT(light);
    r.apex = r.is_point ? l : 0.5f * (low + high);
    r.towards = l;
    r.centre = 0.5f * (low + high) - r.apex;
    r.extent = 0.5f * (high - low);
    r.size = max(fabs(low), fabs(high)) + fabs(r.centre) + r.extent;
    return r;
}

// Test a block against the leaves on the list; false once no ray of it can see the light.
inline int shade_off(const Bvh *bvh, const Shaft *shaft, const ShadowRays *r, const Receiver *receiver, const Receivers *receivers, const Bands *bands,
                     const LeafList *list, int own, global const int *ids, global const float *point, global int *wants)
{
    Plane planes[4];
    private float forms[SHADOW_FORMS * LANES];
    private int rows[2 * LANES];
    for (int base = 0; base < list->count; base += LANES) {
        uint near = row_bits(shaft_meets(shaft, list->boxes + base, list->pitch));
        if (base + LANES > list->count) near &= (1u << (list->count - base)) - 1u;
        for (; near; near &= near - 1) {
            const int leaf = list->leaf[base + lowest(near)];
            for (int lane = 0; lane < NODE_WIDTH; lane += LANES) {
                vi may = setup_occluders(r, shaft, bvh->leaves + leaf * 9 * NODE_WIDTH + lane, planes);
                if (!receiver && receivers->count && row_any(may)) may = darkens_some(receivers, r, planes, may);
                if (!row_any(may)) continue;
                uint keep = receiver ? project_occluders(receiver, planes, may, forms, rows) : store_occluders(planes, may, forms);
                for (; keep; keep &= keep - 1) {
                    const uint k = lowest(keep);
                    const int id = bvh->leaf_ids[leaf * NODE_WIDTH + lane + k];
                    if (id == own) continue;
                    const int left = receiver ? cast_on_facet(forms, k, rows[k], rows[LANES + k], wants)
                                              : cast_shadow(r, bands, forms, k, id, ids, point, wants);
                    if (!left) return 0;
                }
            }
        }
    }
    return 1;
}

// Darken rays in `open` whose hit points lo and hi bound.  `shared` lists the leaves between the light
// and the whole beam when it could hold them (complete), and is used as scratch otherwise.  The block lies on one
// triangle, `own`, whose facet is `cover`; or on `facets`, with hit points and triangles in buffers.
inline void darken(const Bvh *bvh, global const float *light, LeafList *shared, int complete, const Bundle *bundle,
                   const Facet *cover, int own, const Facets *facets, global const int *ids, global const float *point, const float *lo,
                   const float *hi, const Bands *bands, global int *open)
{
    const Shaft shaft = make_shaft(light, lo, hi);
    const ShadowRays rays = shadow_rays(light, lo, hi);
    Receiver facet;
    if (cover) facet = make_receiver(bundle, cover->depth, rays.apex);
    const Receiver *receiver = cover ? &facet : 0;
    Receivers receivers;
    if (!cover) make_receivers(bundle, facets, rays.apex, &receivers);
    if (complete) {
        shade_off(bvh, &shaft, &rays, receiver, &receivers, bands, shared, own, ids, point, open);
        return;
    }
    Walk walk;
    start_walk(&walk);
    while (walk.size) {
        shared->count = 0;
        gather_shaft(bvh, &shaft, &walk, shared);
        if (!shade_off(bvh, &shaft, &rays, receiver, &receivers, bands, shared, own, ids, point, open)) return;
    }
}

// Take from `wants` the rays of a block of several triangles that cannot see the light; `open` and `seen` are scratch.
inline void shadow_block(const Bvh *bvh, global const float *light, LeafList *shared, int complete, const Bundle *bundle,
                         const Facets *facets, global const int *ids, global const float *point, global int *wants,
                         global int *open, global int *seen)
{
    float lo[3], hi[3];
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE((vi)(0), seen + at);
    Bands bands;
    while (next_span(bundle, point, wants, open, lo, hi, &bands)) {
        darken(bvh, light, shared, complete, bundle, 0, -1, facets, ids, point, lo, hi, &bands, open);
        for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(VLOAD(seen + at) | VLOAD(open + at), seen + at);
    }
    for (int at = 0; at < BLOCK_RAYS; at += LANES) VSTORE(VLOAD(seen + at), wants + at);
}
#endif

#endif
