// Which rays of a block are dark: a word a row, a bit a column.
//
// What an occluder takes of a row of rays is an interval: each of its four forms is zero at one column of the row and
// not negative to one side of it.  LANES rows are found at once, the whole block in a few dozen instructions.
#ifndef LFCORE_DARKNESS_CL
#define LFCORE_DARKNESS_CL
#include "occluders.cl"
#include "shares.cl"

#if OUTER == 1
#define ROW_GROUPS (BLOCK / LANES)
// Below this share of a form's size its slope along a row is taken for it: no ray can tell.
#define LEAST_SLOPE 9.0e-13f
#define ANYWHERE 1.0e30f
// More than an inner grid has; less of a level form is rounding.
#define MOST_COLUMNS 16384.0f

typedef struct {
    Rectangle over;     // around the rays, in columns and rows as forms count them
    float2 first;       // column and row of the block's first ray, counted likewise
    vi mine[ROW_GROUPS], dark[ROW_GROUPS];  // rays of the rectangle; dark ones, in and beside it
} Darkness;

inline Darkness none_dark(Rectangle over, float2 first)
{
    Darkness d;
    d.over = over;
    d.first = first;
    const float left = over.x - over.wide - first.x, right = over.x + over.wide - first.x;
    const float top = over.y - over.high - first.y, bottom = over.y + over.high - first.y;
    const int columns = (2 << (int)right) - (1 << (int)left);
    for (int k = 0; k < ROW_GROUPS; ++k) {
        const vf row = IOTA + k * LANES;
        d.mine[k] = GE(row, (vf)(top)) & LE(row, (vf)(bottom)) & (vi)(columns);
        d.dark[k] = 0;
    }
    return d;
}

// Where the zeros of LANES forms lie along a row: column = row * slope + at, with rows counted as the forms count them
// and columns from the block's first.  The form is not negative beyond it, less `before`, and up to it, plus `after`; that
// is ANYWHERE on the side where it does not end.  Of two forms that are each other's negative both have the same zero.
#define LINE_WORDS 4
inline void store_line(Affine e, float first, private float *out)
{
    const vf least = fma(fabs(e.c) + fabs(e.j), (vf)(LEAST_SLOPE), (vf)(1.0e-37f));
    const vi level = LT(fabs(e.i), least), up = level | GT(e.i, (vf)(0.0f));
    const vf inverse = reciprocal(pick(e.i, least, level));
    VSTORE(-e.j * inverse, out);
    VSTORE(-e.c * inverse - first, out + LANES);
    // A form that is zero all along a row is not negative there.
    VSTORE(pick((vf)(ANYWHERE), pick((vf)(0.0f), (vf)(MOST_COLUMNS), level), up), out + 2 * LANES);
    VSTORE(pick((vf)(0.0f), (vf)(ANYWHERE), up), out + 3 * LANES);
}

// Darken what lies behind occluder `lane` of those whose four lines are given.
inline void add_darkness(private const float *lines, uint lane, Darkness *d)
{
    for (int k = 0; k < ROW_GROUPS; ++k) {
        const vf row = IOTA + (d->first.y + k * LANES);
        vf lo = 0.0f, hi = BLOCK - 1;
        for (int form = 0; form < 4; ++form) {
            private const float *line = lines + LINE_WORDS * form * LANES + lane;
            const vf zero = fma(row, (vf)(line[0]), (vf)(line[LANES]));
            lo = max(lo, zero - line[2 * LANES]);
            hi = min(hi, zero + line[3 * LANES]);
        }
        const vi from = TO_VI(ceil(min(lo, (vf)(BLOCK)))), end = TO_VI(floor(max(hi, (vf)(-1.0f)))) + 1;
        d->dark[k] |= (((vi)(1) << end) - 1) & -((vi)(1) << from);
    }
}

inline int some_dark(const Darkness *d)
{
    vi dark = 0;
    for (int k = 0; k < ROW_GROUPS; ++k) dark |= d->dark[k] & d->mine[k];
    return row_any(dark);
}

inline int all_dark(const Darkness *d)
{
    vi lit = 0;
    for (int k = 0; k < ROW_GROUPS; ++k) lit |= d->mine[k] & ~d->dark[k];
    return !row_any(lit);
}

// Leave in `may` those of LANES occluders that one of their forms lets darken some ray in a rectangle, and in `all` those
// that it lets darken every ray.
inline void sift_occluders(Affine e, const Rectangle *over, vi *may, vi *all)
{
    const vf middle = fma(e.i, (vf)(over->x), fma(e.j, (vf)(over->y), e.c));
    const vf wide = 1.00001f * fma(fabs(e.i), (vf)(over->wide), fabs(e.j) * over->high);
    *may &= GE(middle, -wide);
    *all &= GT(middle, wide);
}

// Darken them behind LANES occluders of the forms `e`, their plane's last; false when none is left.
inline int cast_occluders(const Affine *e, vi may, Darkness *d)
{
    vi all = may;
    for (int k = 0; k < 4; ++k) sift_occluders(e[k], &d->over, &may, &all);
    if (!row_any(may)) return 1;
    if (row_any(all)) {
        for (int k = 0; k < ROW_GROUPS; ++k) d->dark[k] = d->mine[k];
        return 0;
    }
    private float lines[4 * LINE_WORDS * LANES];
    for (int k = 0; k < 4; ++k) store_line(e[k], d->first.x, lines + LINE_WORDS * k * LANES);
    for (uint keep = row_bits(may); keep; keep &= keep - 1) add_darkness(lines, lowest(keep), d);
    return !all_dark(d);
}

// How many rays are not dark, of all the rectangle's or, given `ids`, of those on triangle `own`; where some are, `wants`
// receives which.
inline int count_lit(const Darkness *d, global const int *ids, int own, global int *wants)
{
    if (!some_dark(d)) return ALL_RAYS;
    private int rows[BLOCK];
    vi lit = 0, dark = 0;
    for (int k = 0; k < ROW_GROUPS; ++k) VSTORE(d->dark[k], rows + k * LANES);
    for (int row = 0; row < BLOCK; ++row)
        for (int column = 0; column < BLOCK; column += LANES) {
            const int at = row * BLOCK + column;
            const vi hidden = MASK(((vi)(rows[row] >> column) & LANE_BITS) != 0), mine = ids ? EQ(VLOAD(ids + at), (vi)(own)) : (vi)(-1);
            VSTORE(ids ? pick_int(VLOAD(wants + at), ~hidden, mine) : ~hidden, wants + at);
            lit |= mine & ~hidden;
            dark |= mine & hidden;
        }
    return !row_any(lit) ? NO_RAY : row_any(dark) ? SOME_RAYS : ALL_RAYS;
}
#endif
#endif
