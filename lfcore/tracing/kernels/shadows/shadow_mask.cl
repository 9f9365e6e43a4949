// Which rays of a region no occluder hides: a word a row, a bit a column.
//
// What an occluder takes of a row of rays is an interval: each of its four affine functions is zero
// at one column of the row and not negative to one side of it.  LANES rows are found at once.
#pragma once
#include "occluders.cl"
#include "rectangles.cl"

#define ROW_GROUPS (BLOCK / LANES)
#define ANYWHERE 1.0e30f

typedef struct {
    Rectangle over;  // around the rays, in columns and rows as affine functions count them
    float2 first;    // column and row of the block's first ray, counted likewise
    vi lit[ROW_GROUPS];
} ShadowMask;

// The mask of a region before any occluder.  Its block, of that half_extent, lies `offset` from the
// centre that affine functions count from.
inline ShadowMask no_shadow(global const Region *r, float half_extent, float2 offset)
{
    ShadowMask m;
    m.over = region_rectangle(r, half_extent);
    m.over.x += offset.x;
    m.over.y += offset.y;
    m.first = offset - half_extent;
    for (int k = 0; k < ROW_GROUPS; ++k) m.lit[k] = VLOAD(r->rows + k * LANES);
    return m;
}

// The zero of each of LANES affine functions in a row of rays: column = row * SLOPE + AT.  Rows are
// counted as the functions count them, columns from the block's first.  A function is not negative
// in the columns from zero - BEFORE to zero + AFTER; one of the two is ANYWHERE.  A function and
// its negative have the same zero.
enum { SLOPE, AT, BEFORE, AFTER, LINE_ROWS };
inline void store_line(WideAffine e, float first, private float (*out)[LANES])
{
    const vf one = e.of[ONE], x = e.of[X], y = e.of[Y];
    const vf least = fma(fabs(one) + fabs(y), (vf)(LEAST_SLOPE), (vf)(LEAST_LENGTH));
    const vi level = LT(fabs(x), least), up = level | GT(x, (vf)(0.0f));
    const vf inverse = reciprocal(pick(x, least, level));
    VSTORE(-y * inverse, out[SLOPE]);
    VSTORE(-one * inverse - first, out[AT]);
    // An affine function that is zero all along a row is not negative there.
    const vf nothing = 0.0f, all = ANYWHERE;
    VSTORE(pick(all, pick(nothing, (vf)(MOST_COLUMNS), level), up), out[BEFORE]);
    VSTORE(pick(nothing, all, up), out[AFTER]);
}

// Mask out the rays behind occluder `lane` of those whose four lines are given.
inline void mask_out(private float (*lines)[LINE_ROWS][LANES], uint lane, ShadowMask *m)
{
    for (int k = 0; k < ROW_GROUPS; ++k) {
        const vf row = IOTA + (m->first.y + k * LANES);
        vf lo = 0.0f, hi = BLOCK - 1;
        for (int function = 0; function < 4; ++function) {
            private float (*line)[LANES] = lines[function];
            const vf zero = fma(row, (vf)(line[SLOPE][lane]), (vf)(line[AT][lane]));
            lo = max(lo, zero - line[BEFORE][lane]);
            hi = min(hi, zero + line[AFTER][lane]);
        }
        const vi from = TO_VI(ceil(min(lo, (vf)(BLOCK))));
        const vi end = TO_VI(floor(max(hi, (vf)(-1.0f)))) + 1;
        m->lit[k] &= ~((((vi)(1) << end) - 1) & -((vi)(1) << from));
    }
}

// One affine function of each of LANES occluders: `may` keeps those that it lets occlude some ray
// in a rectangle, `all` those that it lets occlude every ray.
inline void classify_occluders(WideAffine e, const Rectangle *over, vi *may, vi *all)
{
    const vf x = e.of[X], y = e.of[Y];
    const vf centre = fma(x, (vf)(over->x), fma(y, (vf)(over->y), e.of[ONE]));
    const vf change = fma(fabs(x), (vf)(over->half_width), fabs(y) * over->half_height);
    *may &= GE(centre, -(BOUND_SLACK * change));
    *all &= GT(centre, BOUND_SLACK * change);
}

// Mask out the rays that LANES occluders hide.  Each has four affine functions in `e`; `may` marks
// the occluders to test.  Returns false once no ray is lit.
inline int cast_occluders(const WideAffine *e, vi may, ShadowMask *m)
{
    vi all = may;
    for (int k = 0; k < 4; ++k) classify_occluders(e[k], &m->over, &may, &all);
    if (!row_any(may)) return 1;
    if (row_any(all)) return 0;
    private float lines[4][LINE_ROWS][LANES];
    for (int k = 0; k < 4; ++k) store_line(e[k], m->first.x, lines[k]);
    for (uint keep = row_bits(may); keep; keep &= keep - 1) mask_out(lines, lowest(keep), m);
    vi lit = 0;
    for (int k = 0; k < ROW_GROUPS; ++k) lit |= m->lit[k];
    return row_any(lit);
}
