// Beams of blocks: the unit of work that one worker takes at a time.
//
// A beam is ELEMENTS neighbouring outer elements (pixels, lens samples, data cameras) times a square
// of SIDE x SIDE blocks of the inner grid.  Blocks of one element come element after element, row by row;
// where a block spans OUTER x OUTER elements, that is all that the beam has.  What leaves a beam does so in
// tiles of 16 x 16 inner rays of one element, element after element.
#ifndef LFCORE_BEAM_CL
#define LFCORE_BEAM_CL
#include "visibility.cl"
#if SCATTERED
#include "scattered.cl"
#endif

#define ELEMENT_BLOCKS (SIDE * SIDE)
#define BEAM_BLOCKS (ELEMENTS / (OUTER * OUTER) * ELEMENT_BLOCKS)
#define REACH (SIDE * INNER)         // inner rays along a side of a beam
#define TILE_SIDE (REACH / BLOCK)    // tiles along it
#define ELEMENT_TILES (TILE_SIDE * TILE_SIDE)
#define BEAM_TILES (ELEMENTS * ELEMENT_TILES)

// The rays of a job: the outer elements, and the inner grid that all of them share.
typedef struct {
    global const float4 *elements;  // ox, oy, dx, dy at the middle of the inner grid: of each of E elements, or,
                                    // for blocks of several, of the middle of each of B groups
    global const int *beams;        // (B, ELEMENTS) element or -1
    float4 step;                    // sx, sy, tx, ty: per column and row of the inner grid
    float2 outer;                   // a, b: per element of a group
    int columns, rows;              // size of the inner grid
    int beams_across, beams_down;   // beams that one group's inner grid takes
} Rays;

#define RAYS_PARAMETERS                     \
    global const float4 *restrict elements, \
    global const int *restrict beams,       \
    const int n_beams,                      \
    const float4 step,                      \
    const float2 outer,                     \
    const int columns,                      \
    const int rows
#define BEAMS_ALONG(size) (((size) + REACH - 1) / REACH)
#define MAKE_RAYS {elements, beams, step, outer, columns, rows, BEAMS_ALONG(columns), BEAMS_ALONG(rows)}

typedef struct {
    int group;                  // which of the groups of elements
    global const int *element;  // (ELEMENTS,)
    int column, row;            // first column and row of the inner grid
    BlockState block[BEAM_BLOCKS];  // z_far is negative for a block without rays
} BeamWork;

// First column and row of a block in the inner grid.
inline int2 block_position(const BeamWork *work, int block)
{
    const int within = block % ELEMENT_BLOCKS;
    return (int2)(work->column + (within % SIDE) * INNER, work->row + (within / SIDE) * INNER);
}

// First column and row of a tile in the inner grid.
inline int2 tile_position(const BeamWork *work, int tile)
{
    const int within = tile % ELEMENT_TILES;
    return (int2)(work->column + (within % TILE_SIDE) * BLOCK, work->row + (within / TILE_SIDE) * BLOCK);
}

// The element of a block's rays at place (u, v) of its OUTER x OUTER, or -1.
inline int block_element(const BeamWork *work, int block, int u, int v)
{
    return work->element[OUTER > 1 ? v * OUTER + u : block / ELEMENT_BLOCKS];
}

// The element of a tile, or -1 if there are no rays or none that are wanted.
inline int tile_element(const BeamWork *work, int tile)
{
    const int within = tile % ELEMENT_TILES, first = (within / TILE_SIDE * SIDE + within % TILE_SIDE) * OUTER;
    return work->block[OUTER > 1 ? first : tile].z_far < 0.0f ? -1 : work->element[tile / ELEMENT_TILES];
}

// The middle ray of what the beam's blocks are counted from.
inline float4 middle_of(const Rays *rays, const BeamWork *work, int block)
{
    return rays->elements[OUTER > 1 ? work->group : work->element[block / ELEMENT_BLOCKS]];
}

// The rays about a place of the inner grid, `extent` columns and rows beyond `at`, of those that `e` is the middle of.
inline Bundle bundle_at(const Rays *rays, float4 e, int2 at, float extent)
{
    const float2 c = convert_float2(at) + extent - 0.5f * (float2)(rays->columns - 1, rays->rows - 1);
    Bundle r;
    r.ox = fma(c.x, rays->step.x, e.x); r.oy = fma(c.y, rays->step.y, e.y);
    r.dx = fma(c.x, rays->step.z, e.z); r.dy = fma(c.y, rays->step.w, e.w);
    r.sx = rays->step.x; r.sy = rays->step.y; r.tx = rays->step.z; r.ty = rays->step.w;
    r.a = rays->outer.x; r.b = rays->outer.y;
    return r;
}

inline Bundle block_bundle(const Rays *rays, const BeamWork *work, int block)
{
    return bundle_at(rays, middle_of(rays, work, block), block_position(work, block), HALF);
}

#if OUTER == 1
#define ELEMENT_HALF (0.5f * (SIDE - 1) * INNER + HALF)

// One element's part of the beam, as if it were one block.
inline Bundle element_bundle(const Rays *rays, const BeamWork *work, int block)
{
    return bundle_at(rays, middle_of(rays, work, block), (int2)(work->column, work->row), ELEMENT_HALF);
}

// Where a block lies from the centre of its element's part, in columns and rows.
inline float2 block_offset(int block)
{
    const int within = block % ELEMENT_BLOCKS;
    return ((float2)(within % SIDE, within / SIDE) - 0.5f * (SIDE - 1)) * INNER;
}
#endif

inline void start_beam(const Rays *rays, int beam, BeamWork *work)
{
    const int squares = rays->beams_across * rays->beams_down, square = beam % squares;
    work->group = beam / squares;
    work->element = rays->beams + work->group * ELEMENTS;
    work->column = (square % rays->beams_across) * REACH;
    work->row = (square / rays->beams_across) * REACH;
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        const int2 at = block_position(work, block);
        const int none = OUTER == 1 && block_element(work, block, 0, 0) < 0;
        clear_block(work->block + block, none || at.x >= rays->columns || at.y >= rays->rows ? -1.0f : FAR);
    }
}

// The first element of a beam; negative if it has none.
inline int first_element(const BeamWork *work)
{
    for (int k = 0; k < ELEMENTS; ++k)
        if (work->element[k] >= 0) return work->element[k];
    return -1;
}

// The interval that holds every ray of the beam.
inline Beam whole_beam(const Rays *rays, const BeamWork *work)
{
    float4 lo = FAR, hi = -FAR;
    for (int block = 0; block < BEAM_BLOCKS; block += ELEMENT_BLOCKS) {
        if (OUTER == 1 && block_element(work, block, 0, 0) < 0) continue;
        lo = min(lo, middle_of(rays, work, block));
        hi = max(hi, middle_of(rays, work, block));
    }
    const float extent = 0.5f * (REACH - 1);
    const float cx = work->column + extent - 0.5f * (rays->columns - 1), cy = work->row + extent - 0.5f * (rays->rows - 1);
    Beam b;
    b.ox_lo = fma(cx, rays->step.x, lo.x); b.ox_hi = fma(cx, rays->step.x, hi.x);
    b.oy_lo = fma(cy, rays->step.y, lo.y); b.oy_hi = fma(cy, rays->step.y, hi.y);
    b.dx_lo = fma(cx, rays->step.z, lo.z); b.dx_hi = fma(cx, rays->step.z, hi.z);
    b.dy_lo = fma(cy, rays->step.w, lo.w); b.dy_hi = fma(cy, rays->step.w, hi.w);
    b.hx = extent * rays->step.x; b.gx = extent * rays->step.z;
    b.hy = extent * rays->step.y; b.gy = extent * rays->step.w;
    b.hu = OUTER_HALF * rays->outer.x; b.gu = OUTER_HALF * rays->outer.y;
    return pad_beam(b);
}

// The farthest that a block still sees of what is to come.
inline float beam_far(const BeamWork *work)
{
    float far = 0.0f;
    for (int block = 0; block < BEAM_BLOCKS; ++block) far = max(far, work->block[block].z_far);
    return far;
}

// Test all blocks against the gathered leaves.
inline void visit_leaves(const Bvh *bvh, const Rays *rays, BeamWork *work, const LeafList *list, global float *z, global int *ids)
{
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        if (work->block[block].z_far < 0.0f) continue;
        const Bundle bundle = block_bundle(rays, work, block);
        visit_block(bvh, &bundle, list, work->block + block, z + block * BLOCK_RAYS, ids + block * BLOCK_RAYS);
    }
}

// Find what every block of the beam sees; a block whose state says BUFFERED has its depths and
// triangles (infinity and -1 where nothing is met) in z and ids, BLOCK_RAYS a block.
inline void see(const Bvh *bvh, const Rays *rays, BeamWork *work, LeafList *list, global float *z, global int *ids)
{
#if SCATTERED
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        if (work->block[block].z_far < 0.0f) continue;
        const Bundle bundle = block_bundle(rays, work, block);
        const int2 where = block_position(work, block);
        see_rays(bvh, &bundle, rays->columns - where.x, rays->rows - where.y, z + block * BLOCK_RAYS, ids + block * BLOCK_RAYS);
        work->block[block].cover = BUFFERED;
    }
#else
    const Beam beam = whole_beam(rays, work);
    Walk walk;
    walk.node[0] = 0; walk.z[0] = 0.0f; walk.size = 1;
    while (walk.size) {
        list->count = 0;
        gather(bvh, &beam, beam_far(work), &walk, list);
        visit_leaves(bvh, rays, work, list, z, ids);
    }
#endif
}

#endif
