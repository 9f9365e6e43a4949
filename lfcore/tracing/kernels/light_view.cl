// Hit points as a light sees them.
//
// Which side of an edge plane a hit point is on depends only on the direction that the light sees it in, so
// the edges of occluders are forms of two coordinates: those of a picture taken from the light (or along its
// direction).  A surface that the light grazes has a large box in space and a small one there.
#ifndef LFCORE_LIGHT_VIEW_CL
#define LFCORE_LIGHT_VIEW_CL
#include "occluders.cl"

// Coordinates u, v in the light's picture, and d: the reciprocal of the distance along the axis kz from a point light,
// or the distance itself towards a direction.
typedef struct {
    int kx, ky, kz;
    float sign;             // of the distance along kz
    float slope_x, slope_y; // of a direction, along kz
    float lo[3], hi[3];     // of the block's hit points
} LightView;

// Boxes of every strip of STRIP rays of a block: one without hit points has lows beyond its highs.
#define STRIP (LANES > 8 ? LANES : 8)
#define STRIPS (BLOCK_RAYS / STRIP)
typedef struct { float lo[3][STRIPS], hi[3][STRIPS]; } Strips;

// Rows of LANES that an occluder takes: a, b, c of each edge, e = a u + b v + c, then a, b, c, g of its plane, with
// g d besides.
#define SHADOW_FORMS 13

inline LightView make_light_view(const ShadowRays *r)
{
    const float3 along = r->is_point ? r->centre : r->towards;
    LightView v;
    v.kz = largest_axis(along);
    v.kx = (v.kz + 1) % 3;
    v.ky = (v.kz + 2) % 3;
    const float most = axis(along, v.kz);
    v.sign = most < 0.0f ? -1.0f : 1.0f;
    v.slope_x = axis(along, v.kx) / most;
    v.slope_y = axis(along, v.ky) / most;
    return v;
}

// Fill `seen` (3, BLOCK_RAYS) with u, v, d of the hit points in `open`, and their boxes.  False if some lie beside
// the light or behind it, where it has no picture of them.
inline int see_from_light(const ShadowRays *r, global const float *point, global const int *open, LightView *view, Strips *strips,
                          global float *seen)
{
    const float apex[3] = {r->apex.x, r->apex.y, r->apex.z};
    vf nearest = FAR;
    for (int k = 0; k < 3; ++k) { view->lo[k] = FAR; view->hi[k] = -FAR; }
    for (int strip = 0; strip < STRIPS; ++strip) {
        vf low[3], high[3];
        for (int k = 0; k < 3; ++k) { low[k] = FAR; high[k] = -FAR; }
        for (int at = strip * STRIP; at < (strip + 1) * STRIP; at += LANES) {
            const vi within = VLOAD(open + at);
            const vf x = VLOAD(point + view->kx * BLOCK_RAYS + at) - apex[view->kx];
            const vf y = VLOAD(point + view->ky * BLOCK_RAYS + at) - apex[view->ky];
            const vf z = VLOAD(point + view->kz * BLOCK_RAYS + at) - apex[view->kz];
            vf c[3];
            if (r->is_point) {
                nearest = pick(nearest, min(nearest, z * view->sign), within);
                c[2] = reciprocal(z * view->sign);
                c[0] = x * c[2];
                c[1] = y * c[2];
            } else {
                c[0] = fma((vf)(-view->slope_x), z, x);
                c[1] = fma((vf)(-view->slope_y), z, y);
                c[2] = z;
            }
            for (int k = 0; k < 3; ++k) {
                VSTORE(c[k], seen + k * BLOCK_RAYS + at);
                low[k] = pick(low[k], min(low[k], c[k]), within);
                high[k] = pick(high[k], max(high[k], c[k]), within);
            }
        }
        for (int k = 0; k < 3; ++k) {
            strips->lo[k][strip] = row_min(low[k]);
            strips->hi[k][strip] = row_max(high[k]);
            view->lo[k] = min(view->lo[k], strips->lo[k][strip]);
            view->hi[k] = max(view->hi[k], strips->hi[k][strip]);
        }
    }
    return row_min(nearest) > 1.0e-4f * max(r->extent.x, max(r->extent.y, r->extent.z));
}

inline vf component(Vec n, int k) { return k == 0 ? n.x : k == 1 ? n.y : n.z; }

// Forms of LANES occluders in the light's picture; returns those of `may` that reach the block's box there.
inline uint store_occluders(const ShadowRays *r, const LightView *view, const Plane *planes, vi may, private float *out)
{
    float middle[3], extent[3], most[3];
    for (int k = 0; k < 3; ++k) {
        middle[k] = 0.5f * (view->lo[k] + view->hi[k]);
        extent[k] = 0.500005f * (view->hi[k] - view->lo[k]);
        most[k] = max(fabs(view->lo[k]), fabs(view->hi[k]));
    }
    for (int k = 0; k < 4; ++k) {
        const vf a = component(planes[k].n, view->kx), b = component(planes[k].n, view->ky), n = component(planes[k].n, view->kz);
        const vf c = r->is_point ? n * view->sign : planes[k].c;
        vf reach = fma(a, (vf)(middle[0]), fma(b, (vf)(middle[1]), c)) + fma(fabs(a), (vf)(extent[0]), fabs(b) * extent[1]);
        vf noise = fma(fabs(a), (vf)(most[0]), fma(fabs(b), (vf)(most[1]), fabs(c)));
        VSTORE(a, out + 3 * k * LANES);
        VSTORE(b, out + (3 * k + 1) * LANES);
        VSTORE(c, out + (3 * k + 2) * LANES);
        if (k == 3) {
            const vf g = r->is_point ? planes[k].c : fma(a, (vf)(view->slope_x), fma(b, (vf)(view->slope_y), n));
            VSTORE(g, out + 12 * LANES);
            reach += fma(g, (vf)(middle[2]), fabs(g) * extent[2]);
            noise = fma(fabs(g), (vf)(most[2]), noise);
        }
        may &= GE(fma(noise, (vf)(2.0e-6f), reach), (vf)(0.0f));
    }
    return row_bits(may);
}

// Strips of the block that an occluder may reach.
inline uint strips_met(const LightView *view, const Strips *strips, private const float *c)
{
    uint met = 0;
    const float u = max(fabs(view->lo[0]), fabs(view->hi[0])), v = max(fabs(view->lo[1]), fabs(view->hi[1]));
    const float d = max(fabs(view->lo[2]), fabs(view->hi[2]));
    for (int first = 0; first < STRIPS; first += LANES) {
        vi may = -1;
        for (int k = 0; k < 4; ++k) {
            const float a = c[3 * k], b = c[3 * k + 1], g = k == 3 ? c[12] : 0.0f;
            const float noise = fma(fabs(a), u, fma(fabs(b), v, fma(fabs(g), d, fabs(c[3 * k + 2]))));
            vf most = fma(noise, 2.0e-6f, c[3 * k + 2]);
            most = fma((vf)(a), VLOAD((a > 0.0f ? strips->hi[0] : strips->lo[0]) + first), most);
            most = fma((vf)(b), VLOAD((b > 0.0f ? strips->hi[1] : strips->lo[1]) + first), most);
            if (k == 3) most = fma((vf)(g), VLOAD((g > 0.0f ? strips->hi[2] : strips->lo[2]) + first), most);
            may &= GE(most, (vf)(0.0f));
        }
        met |= row_bits(may) << first;
    }
    return met;
}

// Darken rays behind one occluder, but for those on it; false when none is left.
inline int cast_shadow(const LightView *view, const Strips *strips, private const float *forms, uint lane, int id,
                       global const int *ids, global const float *seen, global int *wants)
{
    float c[SHADOW_FORMS];
    for (int k = 0; k < SHADOW_FORMS; ++k) c[k] = forms[k * LANES + lane];
    int darker = 0;
    for (uint met = strips_met(view, strips, c); met; met &= met - 1) {
        const int first = lowest(met) * STRIP;
        for (int at = first; at < first + STRIP; at += LANES) {
            const vi open = VLOAD(wants + at);
            const vf u = VLOAD(seen + at), v = VLOAD(seen + BLOCK_RAYS + at), d = VLOAD(seen + 2 * BLOCK_RAYS + at);
#define EDGE_FORM(k) fma(u, (vf)(c[3 * (k)]), fma(v, (vf)(c[3 * (k) + 1]), (vf)(c[3 * (k) + 2])))
            const vf inside = min(EDGE_FORM(0), min(EDGE_FORM(1), EDGE_FORM(2)));
            const vf beyond = fma(d, (vf)(c[12]), EDGE_FORM(3));
#undef EDGE_FORM
            const vi dark = open & GE(inside, (vf)(0.0f)) & GT(beyond, (vf)(0.0f)) & ~EQ(VLOAD(ids + at), (vi)(id));
            if (!row_any(dark)) continue;
            VSTORE(open & ~dark, wants + at);
            darker = 1;
        }
    }
    if (!darker) return 1;
    vi left = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) left |= VLOAD(wants + at);
    return row_any(left);
}

#endif
