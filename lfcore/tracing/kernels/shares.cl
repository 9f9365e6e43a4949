// What each triangle has of a block of one element: which rays, and where in the block they lie.
#ifndef LFCORE_SHARES_CL
#define LFCORE_SHARES_CL
#include "shading.cl"

#if OUTER == 1

// Of a number of rays.
enum { NO_RAY, SOME_RAYS, ALL_RAYS };

typedef struct {
    int id;
    const Facet *facet;
    Rectangle over;                 // around its rays, which see it from one side
    int seeing[SHADOW_LIGHTS + 1];  // how many of them see each light that casts shadows
} Share;

// Light of a share is set up once, and shadows for all blocks of a beam.  Of an inner grid of fewer than DENSE rays along either axis
// a triangle is seen by few blocks, and setting up more than CROWD for one does not pay: measured.
#define SHARES 8
#define CROWD 4
#ifndef DENSE
#define DENSE 256
#endif
typedef struct {
    Share of[SHARES];
    Facet facets[SHARES];
    int count;
} Shares;

// Where the rays of a block lie that meet triangle `own`.
inline Rectangle find_share(global const int *ids, int own)
{
    vu first = BLOCK, last = 0;
    vu columns[BLOCK / LANES];
    for (int k = 0; k < BLOCK / LANES; ++k) columns[k] = 0;
    for (int row = 0; row < BLOCK; ++row)
        for (int k = 0; k < BLOCK / LANES; ++k) {
            const vu mine = AS_VU(EQ(VLOAD(ids + row * BLOCK + k * LANES), (vi)(own)));
            first = min(first, (uint)row | ~mine);
            last = max(last, (uint)row & mine);
            columns[k] |= mine;
        }
    uint met = 0;
    for (int k = 0; k < BLOCK / LANES; ++k) met |= row_bits(AS_VI(columns[k])) << (k * LANES);
    return rectangle_of(lowest(met), 31 - clz(met), row_least(first), row_most(last));
}

// The triangles that a block meets, if they are `most` at most; else a number beyond it.
inline int count_triangles(global const int *ids, int most, private int *found)
{
    int count = 0;
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi row = VLOAD(ids + at);
        vi new = GE(row, (vi)(0));
        for (int k = 0; k < count; ++k) new &= ~EQ(row, (vi)(found[k]));
        for (; row_any(new); ++count) {
            if (count == most) return most + 1;
            found[count] = ids[at + lowest(row_bits(new))];
            new &= ~EQ(row, (vi)(found[count]));
        }
    }
    return count;
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

// Add a triangle's rays, in a rectangle around them, to the shares; false if some may see it edge-on.
inline int add_share(const Surfaces *s, const Bundle *r, int id, Rectangle over, float pixel, Shares *out)
{
    Share *share = out->of + out->count;
    share->id = id;
    share->over = over;
    share->facet = out->facets + out->count;
    prepare_facet(s, r, id, pixel, out->facets + out->count++);
    return one_sided_over(share->facet, over);
}


// The same by the triangles that `ids` says its rays meet.
inline int share_out(const Surfaces *s, const Bundle *r, global const int *ids, int most, float pixel, Shares *out)
{
    int found[SHARES];
    const int count = count_triangles(ids, most, found);
    if (count > most) return 0;
    for (out->count = 0; out->count < count;)
        if (!add_share(s, r, found[out->count], find_share(ids, found[out->count]), pixel, out)) return 0;
    return 1;
}

#endif
#endif
