// Regions: what the tracer's stages hand on.
//
// A region is what one triangle has of a block: the triangle, a mask of sixteen rays for each of
// sixteen rows, and the rectangle around them.  A covered block is one full region.  Whatever comes
// after coverage knows a block by its regions alone.
#pragma once
#include "visibility.cl"

typedef struct {
    int triangle;
    int rows[BLOCK];  // a bit for each ray of a row
    int columns;      // a bit for each column that holds any
    int top, bottom;  // first and last row that hold any
} Region;

typedef struct {
    global Region *of;  // (BLOCK_RAYS,) in the order of their first rays
    int count;
} Regions;

// Columns of a block's row that lie in the inner grid, and whether a row does.
inline int open_columns(int2 inside)
{
    int open = 0;
    for (int k = 0; k < OUTER; ++k) open |= ((1 << inside.x) - 1) << (k * INNER);
    return open;
}
inline int open_row(int row, int2 inside) { return row % INNER < inside.y; }

inline global Region *add_region(Regions *regions, int triangle)
{
    global Region *r = regions->of + regions->count++;
    r->triangle = triangle;
    for (int row = 0; row < BLOCK; row += LANES) VSTORE((vi)(0), r->rows + row);
    r->columns = 0;
    r->top = BLOCK;
    return r;
}

inline void add_rays(global Region *r, int row, int rays)
{
    if (!rays) return;
    r->rows[row] |= rays;
    r->columns |= rays;
    r->top = min(r->top, row);
    r->bottom = row;
}

// Regions by the numbers of their triangles, of which there may be as many as rays.
#define TABLE (2 * BLOCK_RAYS)
inline global Region *find_region(private int *table, int triangle, Regions *regions)
{
    int slot = triangle % TABLE;
    for (; table[slot] >= 0; slot = (slot + 1) % TABLE)
        if (regions->of[table[slot]].triangle == triangle) return regions->of + table[slot];
    table[slot] = regions->count;
    return add_region(regions, triangle);
}

// Sort a depth buffer's rays by their triangles.
inline void sort_rays(const Coverage *c, int open, int2 inside, Regions *out)
{
    private int table[TABLE];
    for (int k = 0; k < TABLE; k += LANES) VSTORE((vi)(-1), table + k);
    global Region *last = 0;
    for (int row = 0; row < BLOCK; ++row) {
        if (!open_row(row, inside)) continue;
        for (int column = 0; column < BLOCK; column += LANES) {
            global const int *ids = c->ids + row * BLOCK + column;
            const vi triangles = VLOAD(ids);
            uint left = row_bits(GE(triangles, (vi)(0))) & (uint)open >> column;
            while (left) {
                const int triangle = ids[lowest(left)];
                const uint rays = row_bits(EQ(triangles, (vi)(triangle))) & left;
                left &= ~rays;
                if (!last || last->triangle != triangle) last = find_region(table, triangle, out);
                add_rays(last, row, rays << column);
            }
        }
    }
}

// The regions of a block, of which only `inside` columns and rows of the inner grid count.
inline void find_regions(const Coverage *c, int2 inside, Regions *out)
{
    out->count = 0;
    if (c->covering_triangle == NOTHING) return;
    const int open = open_columns(inside);
    if (c->covering_triangle == BUFFERED) {
        sort_rays(c, open, inside, out);
        return;
    }
    global Region *all = add_region(out, c->covering_triangle);
    for (int row = 0; row < BLOCK; ++row) all->rows[row] = open_row(row, inside) ? open : 0;
    all->columns = open;
    all->top = 0;
    all->bottom = BLOCK - INNER + inside.y - 1;
}

// Mask of a region's rays in the row of LANES that begins with ray `at`.
inline vi region_row(global const Region *r, int at)
{
    return mask_of_bits(r->rows[at / BLOCK] >> at % BLOCK);
}

// Around the rays of a block of one element, of that half_extent.
inline Rectangle region_rectangle(global const Region *r, float half_extent)
{
    const float left = lowest((uint)r->columns), right = 31 - clz((uint)r->columns);
    const float top = r->top, bottom = r->bottom;
    return (Rectangle){0.5f * (left + right) - half_extent, 0.5f * (top + bottom) - half_extent,
                       0.5f * (right - left), 0.5f * (bottom - top)};
}
