// Shadows of a block of many triangles, in coordinates of a picture taken from the light.
//
// The side of an edge plane on which a hit point is depends only on its direction from the light.
// So occluders' edges are affine functions of two coordinates: those of a picture taken from the
// light, or along its direction.  A surface at grazing incidence has a large box in space and a
// small one in the picture.
#pragma once
#include "occluders.cl"

// Coordinates u, v in the light's picture, and d: the reciprocal of the distance along axis kz from
// a point light, or the distance itself towards a direction.
typedef struct {
    int axes[3];             // kx, ky, kz
    float sign;              // of the distance along kz
    float slope_x, slope_y;  // of a direction, along kz
    float centre[3], half_extent[3];  // of the hit points' box
} LightSpace;

// The least distance of a point light in half extents of the hit points' box.  Nearer lights have
// no picture: coordinates, positions over the distance, are bounded by thirty thousand.
#define NEAREST_SHARE 1.0e-4f

// Upper, then lower bounds of u, v and d of each stripe of STRIPE rays; a stripe without rays has
// lower bounds above upper ones.
#define STRIPE (LANES > 8 ? LANES : 8)
#define STRIPES (BLOCK_RAYS / STRIPE)
typedef struct { float bound[2][3][STRIPES]; } StripeBoxes;

// The most triangles that are tested for all rays: measured.  Before more are, the rays that are still
// lit are sorted, so that neighbours in the light's picture follow each other and the boxes of
// stripes are small.
#define UNSORTED_OCCLUDERS 16

// A set of shadow rays in light space.
typedef struct {
    ShadowRays rays;
    LightSpace space;
    Box box;                         // around u, v and d of the hit points
    StripeBoxes stripes;             // once rays are sorted
    uint lit;                        // a bit per stripe with active rays
    int occluders;                   // tested so far
    int count;                       // of sorted rays; 0: not sorted
    int ray[BLOCK_RAYS];             // their numbers in the block
    int triangle[BLOCK_RAYS];        // on which they start
    int active[BLOCK_RAYS];          // masks
    global float *projected;              // u, v, d of hit points: (3, BLOCK_RAYS)
    global const Hits *hits;
} LightSpaceRays;

inline LightSpace make_light_space(const ShadowRays *r)
{
    const float3 along = r->is_point ? r->centre : r->towards;
    LightSpace v;
    for (int k = 0; k < 3; ++k) v.axes[k] = (largest_axis(along) + 1 + k) % 3;
    const float most = axis(along, v.axes[2]);
    v.sign = most < 0.0f ? -1.0f : 1.0f;
    v.slope_x = axis(along, v.axes[0]) / most;
    v.slope_y = axis(along, v.axes[1]) / most;
    return v;
}

// u, v, d of a row of hit points.
inline Vec project_row(const ShadowRays *r, const LightSpace *space, global const float *point,
                       int at)
{
    vf x[3];
    for (int k = 0; k < 3; ++k)
        x[k] = VLOAD(point + space->axes[k] * BLOCK_RAYS + at) - axis(r->apex, space->axes[k]);
    if (r->is_point) {
        const vf inverse = reciprocal(x[2] * space->sign);
        return (Vec){x[0] * inverse, x[1] * inverse, inverse};
    }
    return (Vec){fma((vf)(-space->slope_x), x[2], x[0]), fma((vf)(-space->slope_y), x[2], x[1]),
                 x[2]};
}

inline void set_range(const Box *hits, LightSpace *space)
{
    for (int k = 0; k < 3; ++k) {
        space->centre[k] = 0.5f * (hits->lo[k] + hits->hi[k]);
        space->half_extent[k] = 0.5f * BOUND_SLACK * (hits->hi[k] - hits->lo[k]);
    }
}

// An occluder in the light's picture: a u + b v + c per edge, and a u + b v + g d + c for its
// plane; MOST_C is c plus a bound of the function's rounding errors.
enum { TERM_A, TERM_B, TERM_G, TERM_C, MOST_C, PICTURE_TERMS };
typedef struct { float edge[4][PICTURE_TERMS][LANES]; } PictureEdges;

// A bound of the rounding errors of a u + b v + g d + c, of two or three `terms` and c, at hit
// points.
inline vf picture_error(const LightSpace *space, const vf *f, int terms)
{
    vf most = fabs(f[TERM_C]);
    for (int k = 0; k < terms; ++k)
        most = fma(fabs(f[k]), (vf)(fabs(space->centre[k]) + space->half_extent[k]), most);
    return LIGHT_SPACE_ERROR * most;
}

// The largest value of the function over the hit points' box.
inline vf most_in_picture(const LightSpace *space, const vf *f, int terms)
{
    vf most = f[MOST_C];
    for (int k = 0; k < terms; ++k)
        most += fma(f[k], (vf)(space->centre[k]), fabs(f[k]) * space->half_extent[k]);
    return most;
}

// The bin along u or v, of SORT_BINS x SORT_BINS over the hit points, with its bits spread apart.
#define SORT_BINS 16
inline vi bin_bits(vf x, float lo, float hi)
{
    const float scale = SORT_BINS / max(hi - lo, LEAST_LENGTH);
    vi bin = clamp(TO_VI((x - lo) * scale), (vi)(0), (vi)(SORT_BINS - 1));
    bin = (bin | bin << 2) & 0x33;
    return (bin | bin << 1) & 0x55;
}

// Sort the active rays along a Z-curve through these bins.
inline void sort_hits(const Shadows *s, LightSpaceRays *l)
{
    global const float *projected = s->projected;
    private int bin[BLOCK_RAYS], end[SORT_BINS * SORT_BINS] = {0};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi u = bin_bits(VLOAD(projected + at), l->box.lo[0], l->box.hi[0]);
        const vi v = bin_bits(VLOAD(projected + BLOCK_RAYS + at), l->box.lo[1], l->box.hi[1]);
        VSTORE(u | v << 1, bin + at);
    }
    for (int ray = 0; ray < BLOCK_RAYS; ++ray)
        if (l->active[ray]) ++end[bin[ray]];
    l->projected = s->projected + 3 * BLOCK_RAYS;
    for (int k = 0; k < SORT_BINS * SORT_BINS; ++k) {
        const int count = end[k];
        end[k] = l->count;
        l->count += count;
    }
    for (int ray = 0; ray < BLOCK_RAYS; ++ray) {
        if (!l->active[ray]) continue;
        const int at = end[bin[ray]]++;
        l->ray[at] = ray;
        l->triangle[at] = l->hits->triangle[ray];
        for (int k = 0; k < 3; ++k)
            l->projected[k * BLOCK_RAYS + at] = projected[k * BLOCK_RAYS + ray];
    }
}

inline void bound_stripes(LightSpaceRays *l)
{
    l->lit = 0;
    for (int stripe = 0; stripe < STRIPES; ++stripe) {
        Ranges ranges;
        clear_ranges(&ranges);
        for (int at = stripe * STRIPE; at < (stripe + 1) * STRIPE; at += LANES) {
            const vi within = LT(TO_VI(IOTA) + at, (vi)(l->count));
            VSTORE(within, l->active + at);
            add_to_ranges(&ranges, load3(l->projected, at), within);
        }
        const Box box = box_of(&ranges);
        for (int k = 0; k < 3; ++k) {
            l->stripes.bound[0][k][stripe] = box.hi[k];
            l->stripes.bound[1][k][stripe] = box.lo[k];
        }
        l->lit |= (uint)(stripe * STRIPE < l->count) << stripe;
    }
}

// Project the rays in s->active into light space.  False if some are beside or behind the light,
// where there is no picture.
inline int project_hits(const Shadows *s, LightSpaceRays *l)
{
    Ranges ranges;
    clear_ranges(&ranges);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Vec row = project_row(&l->rays, &l->space, s->origins, at);
        store3(row, s->projected, at);
        add_to_ranges(&ranges, row, VLOAD(s->active + at));
        VSTORE(VLOAD(s->active + at), l->active + at);
        VSTORE(VLOAD(l->hits->triangle + at), l->triangle + at);
        VSTORE(TO_VI(IOTA) + at, l->ray + at);
    }
    l->box = box_of(&ranges);
    set_range(&l->box, &l->space);
    const float nearest = NEAREST_SHARE * largest_component(l->rays.half_extent);
    l->projected = s->projected;
    return !l->rays.is_point || (l->box.lo[2] > 0.0f && l->box.hi[2] * nearest < 1.0f);
}

inline vf component(Vec n, int k) { return k == 0 ? n.x : k == 1 ? n.y : n.z; }

// Set up LANES triangles of a leaf; returns those of `may` that reach the hit points' box in
// the picture.
inline uint set_up_picture(const ShadowRays *r, const LightSpace *space, global const Leaf *leaf,
                           int lane, vi may, PictureEdges *out)
{
    Occluders o;
    load_corners(leaf, lane, r->apex, o.v);
#pragma unroll
    for (int k = 3; k >= 0 && row_any(may); --k) {
        const HalfSpace plane = k == 3 ? face_plane(r, &o, &may) : edge_plane(r, &o, k);
        const vf a = component(plane.n, space->axes[0]), b = component(plane.n, space->axes[1]);
        const vf n = component(plane.n, space->axes[2]);
        const int terms = k == 3 ? 3 : 2;
        const vf along = fma(a, (vf)(space->slope_x), fma(b, (vf)(space->slope_y), n));
        vf f[PICTURE_TERMS] = {a, b, 0.0f, r->is_point ? n * space->sign : plane.c};
        if (k == 3) f[TERM_G] = r->is_point ? plane.c : along;
        f[MOST_C] = f[TERM_C] + picture_error(space, f, terms);
        for (int term = 0; term < PICTURE_TERMS; ++term) VSTORE(f[term], out->edge[k][term]);
        may &= GE(most_in_picture(space, f, terms), (vf)(0.0f));
    }
    return row_bits(may);
}

// Find the occluders among `keep` that may reach each of the `lit` stripes, a bit per occluder.
inline void reach_stripes(const StripeBoxes *stripes, const PictureEdges *f, uint keep, uint lit,
                          private int *reaching)
{
    for (int first = 0; first < STRIPES; first += LANES) {
        if (!(lit >> first & ((1u << LANES) - 1u))) continue;
        vf most[3], least[3];
        for (int axis = 0; axis < 3; ++axis) {
            most[axis] = VLOAD(stripes->bound[0][axis] + first);
            least[axis] = VLOAD(stripes->bound[1][axis] + first);
        }
        vi reached = 0;
        for (uint left = keep; left; left &= left - 1) {
            const uint lane = lowest(left);
            vi may = -1;
#pragma unroll
            for (int k = 0; k < 4; ++k) {
                private const float (*function)[LANES] = f->edge[k];
                vf largest = function[MOST_C][lane];
                for (int axis = 0; axis < (k == 3 ? 3 : 2); ++axis) {
                    // The sign selects, because a branch is unpredictable; 16 lanes select in
                    // memory.
                    const vf x = function[axis][lane];
                    const uint side = as_uint(function[axis][lane]) >> 31;
                    const vf bound = LANES > 8 ? VLOAD(stripes->bound[side][axis] + first)
                                               : select(most[axis], least[axis], AS_VI(x) >> 31);
                    largest = fma(x, bound, largest);
                }
                may &= GE(largest, (vf)(0.0f));
            }
            reached |= may & (vi)(1 << lane);
        }
        VSTORE(reached, reaching + first);
    }
}

// The hit points among `bits` of a row, all behind an occluder, that its holes leave dark.
inline uint behind_holes(const Shadows *s, const LightSpaceRays *l, int occluder, int at, uint bits)
{
    const float3 p = corner(s->scene, occluder, 0), n = geometric_normal(s->scene, occluder);
    uint dark = 0;
    for (; bits; bits &= bits - 1) {
        const uint k = lowest(bits);
        global const float *point = s->origins + l->ray[at + k];
        const float3 from = (float3)(point[0], point[BLOCK_RAYS], point[2 * BLOCK_RAYS]);
        const float3 to = l->rays.towards - (l->rays.is_point ? from : 0.0f);
        const float way = inner_product(n, p - from) / inner_product(n, to);
        dark |= (uint)is_solid(&s->tree->alpha_tests, occluder, from + way * to) << k;
    }
    return dark;
}

// Mask of the rays of a row behind occluder `lane`, triangle `id`, that do not start on it.
inline vi behind_occluder(const PictureEdges *f, uint lane, int id, Vec projected, vi triangle)
{
    vf function[4];
    for (int k = 0; k < 4; ++k) {
        private const float (*term)[LANES] = f->edge[k];
        function[k] = fma(projected.x, (vf)(term[TERM_A][lane]),
                      fma(projected.y, (vf)(term[TERM_B][lane]), (vf)(term[TERM_C][lane])));
    }
    const vf beyond = fma(projected.z, (vf)(f->edge[3][TERM_G][lane]), function[3]);
    const vi inside = GE(min(function[0], min(function[1], function[2])), (vf)(0.0f));
    return inside & GT(beyond, (vf)(0.0f)) & ~EQ(triangle, (vi)(id));
}

// Remove from l->active the rays of a stripe behind the occluders `keep`, with triangles `ids`.
inline void cast_stripe(const Shadows *s, const PictureEdges *f, uint keep, global const int *ids,
                       int stripe, LightSpaceRays *l)
{
    vi lit = 0;
    for (int at = stripe * STRIPE; at < (stripe + 1) * STRIPE; at += LANES) {
        vi active = VLOAD(l->active + at);
        const Vec projected = load3(l->projected, at);
        const vi triangle = VLOAD(l->triangle + at);
        for (uint left = keep; left; left &= left - 1) {
            const uint lane = lowest(left);
            vi dark = active & behind_occluder(f, lane, ids[lane], projected, triangle);
            if (has_holes(&s->tree->alpha_tests, ids[lane]))
                dark = mask_of_bits(behind_holes(s, l, ids[lane], at, row_bits(dark)));
            active &= ~dark;
        }
        VSTORE(active, l->active + at);
        lit |= active;
    }
    if (!row_any(lit)) l->lit ^= 1u << stripe;
}

// Remove from l->active the rays behind LANES triangles of a leaf.
inline void cast_leaf(const Shadows *s, int leaf, int lane, LightSpaceRays *l)
{
    global const Leaf *corners = s->tree->leaves + leaf;
    global const int *ids = triangle_ids(s->tree, leaf, lane);
    PictureEdges edges;
    const vi may = sweep_overlaps_leaf(&l->rays.shaft, corners, lane, l->rays.end) &
                   ~(are_of_light(l->rays.light_triangles, ids) | are_clear(s->scene, ids));
    const uint keep = set_up_picture(&l->rays, &l->space, corners, lane, may, &edges);
    if (!keep) return;
    private int reaching[STRIPES];
    l->occluders += popcount(keep);
    if (l->occluders > UNSORTED_OCCLUDERS && !l->count) {
        sort_hits(s, l);
        bound_stripes(l);
    }
    if (l->count) reach_stripes(&l->stripes, &edges, keep, l->lit, reaching);
    else for (int k = 0; k < STRIPES; ++k) reaching[k] = keep;
    for (uint left = l->lit; left; left &= left - 1) {
        const uint stripe = lowest(left);
        if (reaching[stripe]) cast_stripe(s, &edges, reaching[stripe], ids, stripe, l);
    }
}

// Remove from s->active the rays that are occluded; false if the light has no picture of them.
inline int cast_light_space(const Shadows *s, global const Hits *hits, const ShadowRays *rays)
{
    LightSpaceRays l;
    l.rays = *rays;
    l.space = make_light_space(rays);
    l.hits = hits;
    l.occluders = l.count = 0;
    l.lit = (uint)((1ul << STRIPES) - 1);
    if (!project_hits(s, &l)) return 0;
    Stack stack;
    start_walk(&stack);
    for (int leaf; l.lit && (leaf = next_occluding(s->tree, rays, &stack)) >= 0;)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) cast_leaf(s, leaf, lane, &l);
    // Rays that are not among the sorted ones were dark before.
    for (int at = 0; at < BLOCK_RAYS; at += LANES)
        VSTORE(l.count ? (vi)(0) : VLOAD(l.active + at), s->active + at);
    for (int at = 0; at < l.count; ++at) s->active[l.ray[at]] = l.active[at];
    return 1;
}
