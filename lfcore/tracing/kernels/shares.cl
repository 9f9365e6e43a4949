// What each triangle has of a block of one element: which rays, and where in the block they lie.
#ifndef LFCORE_SHARES_CL
#define LFCORE_SHARES_CL
#include "shading.cl"

#if OUTER == 1

typedef struct {
    int id;
    const Facet *facet;
    Rectangle over;     // around its rays, which see it from one side
} Share;

#define SHARES 4
typedef struct {
    Share of[SHARES];
    Facet facets[SHARES];
    int count;
} Shares;

// Find where the rays of a block lie that meet triangle `own`.  Returns the next larger one in the block, -1 after the last.
inline int find_share(global const int *ids, int own, Rectangle *over)
{
    vu first = BLOCK, last = 0, next = -1;
    vu columns[BLOCK / LANES];
    for (int k = 0; k < BLOCK / LANES; ++k) columns[k] = 0;
    for (int row = 0; row < BLOCK; ++row)
        for (int k = 0; k < BLOCK / LANES; ++k) {
            const vi id = VLOAD(ids + row * BLOCK + k * LANES);
            const vu mine = AS_VU(EQ(id, (vi)(own)));
            first = min(first, (uint)row | ~mine);
            last = max(last, (uint)row & mine);
            columns[k] |= mine;
            next = min(next, AS_VU(id) | ~AS_VU(GT(id, (vi)(own))));  // none is the largest unsigned
        }
    uint met = 0;
    for (int k = 0; k < BLOCK / LANES; ++k) met |= row_bits(AS_VI(columns[k])) << (k * LANES);
    const float left = lowest(met), right = 31 - clz(met), top = row_least(first), bottom = row_most(last);
    over->x = 0.5f * (left + right) - HALF;
    over->y = 0.5f * (top + bottom) - HALF;
    over->wide = 0.5f * (right - left);
    over->high = 0.5f * (bottom - top);
    return (int)row_least(next);
}

// Whether a facet is seen from one side all over a rectangle of its block.
inline int one_sided_over(const Facet *f, Rectangle at)
{
    const float middle = f->under.c + at.x * f->under.i + at.y * f->under.j;
    const float noise = 1.0e-6f * (fabs(f->under.c) + fabs(at.x * f->under.i) + fabs(at.y * f->under.j));
    return middle > noise + 1.00001f * (at.wide * fabs(f->under.i) + at.high * fabs(f->under.j));
}

inline Share whole_block(int id, const Facet *facet)
{
    Share share = {id, facet, {0.0f, 0.0f, HALF, HALF}};
    return share;
}

// Share out a block among the triangles that it meets; false where they are many, or some ray sees one edge-on.
inline int share_out(const Surfaces *s, const Bundle *r, global const int *ids, float pixel, Shares *out)
{
    Rectangle nothing;
    int count = 0;
    for (int id = find_share(ids, -1, &nothing); id >= 0; ++count) {
        if (count == SHARES) return 0;
        Share *share = out->of + count;
        share->id = id;
        share->facet = out->facets + count;
        prepare_facet(s, r, id, pixel, out->facets + count);
        id = find_share(ids, id, &share->over);
        if (!one_sided_over(share->facet, share->over)) return 0;
    }
    out->count = count;
    return 1;
}

#endif
#endif
