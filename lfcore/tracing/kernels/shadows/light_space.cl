// Shadows of a block of many triangles, in coordinates of a picture taken from the light.
//
// Which side of an edge plane a hit point is on depends only on the direction that the light sees
// it in, so the edges of occluders are affine functions of two coordinates: those of a picture
// taken from the light, or along its direction.  A surface that the light grazes has a large box in
// space and a small one there.
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

// A point light nearer than this share of half the hit points' box has no picture of them:
// coordinates there, positions over the distance, are thirty thousand at the most.
#define NEAREST_SHARE 1.0e-4f

// The most, then the least, of u, v and d of each stripe, STRIPE rays; without rays crossed.
#define STRIPE (LANES > 8 ? LANES : 8)
#define STRIPES (BLOCK_RAYS / STRIPE)
typedef struct { float of[2][3][STRIPES]; } StripeBoxes;

// A set of shadow rays in light space.  Neighbours in the light's picture follow each other, so
// that the boxes of stripes are small.
typedef struct {
    ShadowRays rays;
    LightSpace space;
    StripeBoxes stripes;
    uint lit;                        // stripes that have any active rays, a bit each
    int count;                       // of rays
    int ray[BLOCK_RAYS];             // their numbers in the block
    int triangle[BLOCK_RAYS];        // on which they start
    int active[BLOCK_RAYS];          // masks
    global float *seen;              // u, v, d of their hit points: (3, BLOCK_RAYS)
    global const Samples *samples;   // of the block
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

// An occluder in the light's picture: a u + b v + c of each edge, and of its plane, with g d
// besides; and c with a bound of the function's rounding errors added.
enum { TERM_A, TERM_B, TERM_G, TERM_C, MOST_C, PICTURE_TERMS };
typedef struct { float of[4][PICTURE_TERMS][LANES]; } PictureEdges;

// A bound of the rounding errors of a u + b v + g d + c, of two or three `terms` and c, at hit
// points.
inline vf picture_error(const LightSpace *space, const vf *f, int terms)
{
    vf most = fabs(f[TERM_C]);
    for (int k = 0; k < terms; ++k)
        most = fma(fabs(f[k]), (vf)(fabs(space->centre[k]) + space->half_extent[k]), most);
    return LIGHT_SPACE_ERROR * most;
}

// The most of it over the hit points' box.
inline vf most_in_picture(const LightSpace *space, const vf *f, int terms)
{
    vf most = f[MOST_C];
    for (int k = 0; k < terms; ++k)
        most += fma(f[k], (vf)(space->centre[k]), fabs(f[k]) * space->half_extent[k]);
    return most;
}

// The cell along u or v of SORT_CELLS x SORT_CELLS over the hit points, its bits apart.
#define SORT_CELLS 16
inline vi cell_bits(vf x, float lo, float hi)
{
    const float scale = SORT_CELLS / max(hi - lo, LEAST_LENGTH);
    vi cell = clamp(TO_VI((x - lo) * scale), (vi)(0), (vi)(SORT_CELLS - 1));
    cell = (cell | cell << 2) & 0x33;
    return (cell | cell << 1) & 0x55;
}

// Sort the rays in s->active along a Z-curve through these cells.
inline void sort_hits(const Shadows *s, global const float *seen, const Box *hits,
                      LightSpaceRays *l)
{
    private int cell[BLOCK_RAYS], end[SORT_CELLS * SORT_CELLS] = {0};
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi u = cell_bits(VLOAD(seen + at), hits->lo[0], hits->hi[0]);
        const vi v = cell_bits(VLOAD(seen + BLOCK_RAYS + at), hits->lo[1], hits->hi[1]);
        VSTORE(u | v << 1, cell + at);
    }
    for (int ray = 0; ray < BLOCK_RAYS; ++ray)
        if (s->active[ray]) ++end[cell[ray]];
    l->count = 0;
    for (int k = 0; k < SORT_CELLS * SORT_CELLS; ++k) {
        const int count = end[k];
        end[k] = l->count;
        l->count += count;
    }
    for (int ray = 0; ray < BLOCK_RAYS; ++ray) {
        if (!s->active[ray]) continue;
        const int at = end[cell[ray]]++;
        l->ray[at] = ray;
        l->triangle[at] = l->samples->triangle[ray];
        for (int k = 0; k < 3; ++k) l->seen[k * BLOCK_RAYS + at] = seen[k * BLOCK_RAYS + ray];
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
            add_to_ranges(&ranges, load3(l->seen, at), within);
        }
        const Box box = box_of(&ranges);
        for (int k = 0; k < 3; ++k) {
            l->stripes.of[0][k][stripe] = box.hi[k];
            l->stripes.of[1][k][stripe] = box.lo[k];
        }
        l->lit |= (uint)(stripe * STRIPE < l->count) << stripe;
    }
}

// Take the rays in s->active into light space.  False if some lie beside the light or behind it,
// where it has no picture of them.
inline int project_hits(const Shadows *s, LightSpaceRays *l)
{
    Ranges ranges;
    clear_ranges(&ranges);
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const Vec row = project_row(&l->rays, &l->space, s->origins, at);
        store3(row, s->seen, at);
        add_to_ranges(&ranges, row, VLOAD(s->active + at));
    }
    const Box hits = box_of(&ranges);
    set_range(&hits, &l->space);
    const float nearest = NEAREST_SHARE * largest_component(l->rays.half_extent);
    if (l->rays.is_point && !(hits.lo[2] > 0.0f && hits.hi[2] * nearest < 1.0f)) return 0;
    l->seen = s->seen + 3 * BLOCK_RAYS;
    sort_hits(s, s->seen, &hits, l);
    bound_stripes(l);
    return 1;
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
        for (int term = 0; term < PICTURE_TERMS; ++term) VSTORE(f[term], out->of[k][term]);
        may &= GE(most_in_picture(space, f, terms), (vf)(0.0f));
    }
    return row_bits(may);
}

// Which of the occluders `keep` may reach each stripe, a bit each; only stripes that are `lit`
// count.
inline void reach_stripes(const StripeBoxes *stripes, const PictureEdges *f, uint keep, uint lit,
                          private int *reaching)
{
    for (int first = 0; first < STRIPES; first += LANES) {
        if (!(lit >> first & ((1u << LANES) - 1u))) continue;
        vf most[3], least[3];
        for (int axis = 0; axis < 3; ++axis) {
            most[axis] = VLOAD(stripes->of[0][axis] + first);
            least[axis] = VLOAD(stripes->of[1][axis] + first);
        }
        vi found = 0;
        for (uint left = keep; left; left &= left - 1) {
            const uint lane = lowest(left);
            vi may = -1;
#pragma unroll
            for (int k = 0; k < 4; ++k) {
                private const float (*function)[LANES] = f->of[k];
                vf largest = function[MOST_C][lane];
                for (int axis = 0; axis < (k == 3 ? 3 : 2); ++axis) {
                    // Its sign selects, as no branch could foresee; 16 lanes do so in memory.
                    const vf x = function[axis][lane];
                    const uint side = as_uint(function[axis][lane]) >> 31;
                    const vf bound = LANES > 8 ? VLOAD(stripes->of[side][axis] + first)
                                               : select(most[axis], least[axis], AS_VI(x) >> 31);
                    largest = fma(x, bound, largest);
                }
                may &= GE(largest, (vf)(0.0f));
            }
            found |= may & (vi)(1 << lane);
        }
        VSTORE(found, reaching + first);
    }
}

// Of a row of hit points, `bits` of which lie behind an occluder, those that its holes leave dark.
inline uint behind_holes(const Shadows *s, const LightSpaceRays *l, int occluder, int at, uint bits)
{
    const float3 p = corner(s->scene, occluder, 0);
    const float3 n = cross_product(corner(s->scene, occluder, 1) - p,
                                   corner(s->scene, occluder, 2) - p);
    uint dark = 0;
    for (; bits; bits &= bits - 1) {
        const uint k = lowest(bits);
        global const float *point = s->origins + l->ray[at + k];
        const float3 from = (float3)(point[0], point[BLOCK_RAYS], point[2 * BLOCK_RAYS]);
        const float3 to = l->rays.towards - (l->rays.is_point ? from : 0.0f);
        const float way = inner_product(n, p - from) / inner_product(n, to);
        dark |= (uint)is_solid(&s->tree->cut_outs, occluder, from + way * to) << k;
    }
    return dark;
}

// Of a row of rays, those behind occluder `lane`, triangle `id`, and not on it.
inline vi behind_occluder(const PictureEdges *f, uint lane, int id, Vec seen, vi triangle)
{
    vf function[4];
    for (int k = 0; k < 4; ++k) {
        private const float (*term)[LANES] = f->of[k];
        function[k] = fma(seen.x, (vf)(term[TERM_A][lane]),
                      fma(seen.y, (vf)(term[TERM_B][lane]), (vf)(term[TERM_C][lane])));
    }
    const vf beyond = fma(seen.z, (vf)(f->of[3][TERM_G][lane]), function[3]);
    const vi inside = GE(min(function[0], min(function[1], function[2])), (vf)(0.0f));
    return inside & GT(beyond, (vf)(0.0f)) & ~EQ(triangle, (vi)(id));
}

// Take from l->active the rays of a stripe behind the occluders `keep`, of triangles `ids`.
inline void cast_stripe(const Shadows *s, const PictureEdges *f, uint keep, global const int *ids,
                       int stripe, LightSpaceRays *l)
{
    vi lit = 0;
    for (int at = stripe * STRIPE; at < (stripe + 1) * STRIPE; at += LANES) {
        vi active = VLOAD(l->active + at);
        const Vec seen = load3(l->seen, at);
        const vi triangle = VLOAD(l->triangle + at);
        for (uint left = keep; left; left &= left - 1) {
            const uint lane = lowest(left);
            vi dark = active & behind_occluder(f, lane, ids[lane], seen, triangle);
            if (has_holes(&s->tree->cut_outs, ids[lane]))
                dark = mask_of_bits(behind_holes(s, l, ids[lane], at, row_bits(dark)));
            active &= ~dark;
        }
        VSTORE(active, l->active + at);
        lit |= active;
    }
    if (!row_any(lit)) l->lit ^= 1u << stripe;
}

// Take from l->active the rays behind LANES triangles of a leaf.
inline void cast_leaf(const Shadows *s, int leaf, int lane, LightSpaceRays *l)
{
    global const Leaf *corners = s->tree->leaves + leaf;
    global const int *ids = triangle_ids(s->tree, leaf, lane);
    PictureEdges edges;
    const vi may = sweep_overlaps_leaf(&l->rays.shaft, corners, lane, l->rays.end) &
                   ~are_of_light(l->rays.light_triangles, ids);
    const uint keep = set_up_picture(&l->rays, &l->space, corners, lane, may, &edges);
    if (!keep) return;
    private int reaching[STRIPES];
    reach_stripes(&l->stripes, &edges, keep, l->lit, reaching);
    for (uint left = l->lit; left; left &= left - 1) {
        const uint stripe = lowest(left);
        if (reaching[stripe]) cast_stripe(s, &edges, reaching[stripe], ids, stripe, l);
    }
}

// Take from s->active the rays that something hides from the light; false if the light has no
// picture of them.
inline int cast_light_space(const Shadows *s, const Block *b, const ShadowRays *rays)
{
    LightSpaceRays l;
    l.rays = *rays;
    l.space = make_light_space(rays);
    l.samples = b->samples;
    if (!project_hits(s, &l)) return 0;
    Stack stack;
    start_walk(&stack);
    for (int leaf; l.lit && (leaf = next_hiding(s->tree, rays, &stack)) >= 0;)
        for (int lane = 0; lane < NODE_WIDTH; lane += LANES) cast_leaf(s, leaf, lane, &l);
    for (int at = 0; at < l.count; ++at) s->active[l.ray[at]] = l.active[at];
    return 1;
}
