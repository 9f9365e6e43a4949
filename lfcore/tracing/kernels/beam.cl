// Beams of blocks: the unit of work that one worker takes at a time.
//
// A beam is ELEMENTS neighbouring outer elements (pixels, lens samples, data cameras) times a square
// of SIDE x SIDE blocks of the inner grid.  Its block b = element * SIDE * SIDE + row * SIDE + column.
#ifndef LFCORE_BEAM_CL
#define LFCORE_BEAM_CL
#include "visibility.cl"
#if SCATTERED
#include "scattered.cl"
#endif

#define ELEMENT_BLOCKS (SIDE * SIDE)
#define BEAM_BLOCKS (ELEMENTS * ELEMENT_BLOCKS)

// The rays of a job: the outer elements, and the inner grid that all of them share.
typedef struct {
    global const float4 *elements;  // (E,) ox, oy, dx, dy at the middle of the inner grid
    global const int *beams;        // (B, ELEMENTS) element or -1
    float4 step;                    // sx, sy, tx, ty: per column and row of the inner grid
    int columns, rows;              // size of the inner grid
    int beams_across, beams_down;   // squares of SIDE blocks in the inner grid
} Rays;

#define RAYS_PARAMETERS                     \
    global const float4 *restrict elements, \
    global const int *restrict beams,       \
    const int n_beams,                      \
    const float4 step,                      \
    const int columns,                      \
    const int rows
#define SQUARES(size) (((size) + SIDE * BLOCK - 1) / (SIDE * BLOCK))
#define MAKE_RAYS {elements, beams, step, columns, rows, SQUARES(columns), SQUARES(rows)}

typedef struct {
    global const int *element;  // (ELEMENTS,)
    int column, row;            // first column and row of the inner grid
    BlockState block[BEAM_BLOCKS];  // z_far is negative for a block without rays
} BeamWork;

// First column and row of a block in the inner grid.
inline int2 block_position(const BeamWork *work, int block)
{
    const int within = block % ELEMENT_BLOCKS;
    return (int2)(work->column + (within % SIDE) * BLOCK, work->row + (within / SIDE) * BLOCK);
}

inline Bundle block_bundle(const Rays *rays, const BeamWork *work, int block)
{
    const float4 e = rays->elements[work->element[block / ELEMENT_BLOCKS]];
    const float2 c = convert_float2(block_position(work, block)) + HALF - 0.5f * (float2)(rays->columns - 1, rays->rows - 1);
    Bundle r;
    r.ox = fma(c.x, rays->step.x, e.x); r.oy = fma(c.y, rays->step.y, e.y);
    r.dx = fma(c.x, rays->step.z, e.z); r.dy = fma(c.y, rays->step.w, e.w);
    r.sx = rays->step.x; r.sy = rays->step.y; r.tx = rays->step.z; r.ty = rays->step.w;
    return r;
}

inline void start_beam(const Rays *rays, int beam, BeamWork *work)
{
    const int squares = rays->beams_across * rays->beams_down, square = beam % squares;
    work->element = rays->beams + (beam / squares) * ELEMENTS;
    work->column = (square % rays->beams_across) * SIDE * BLOCK;
    work->row = (square / rays->beams_across) * SIDE * BLOCK;
    for (int block = 0; block < BEAM_BLOCKS; ++block) {
        const int2 at = block_position(work, block);
        const int empty = work->element[block / ELEMENT_BLOCKS] < 0 || at.x >= rays->columns || at.y >= rays->rows;
        work->block[block].z_far = empty ? -1.0f : FAR;
        work->block[block].cover = NOTHING;
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
    for (int k = 0; k < ELEMENTS; ++k) {
        if (work->element[k] < 0) continue;
        const float4 e = rays->elements[work->element[k]];
        lo = min(lo, e);
        hi = max(hi, e);
    }
    const float cx = work->column + 0.5f * (SIDE * BLOCK - 1) - 0.5f * (rays->columns - 1);
    const float cy = work->row + 0.5f * (SIDE * BLOCK - 1) - 0.5f * (rays->rows - 1);
    const float extent = 0.5f * (SIDE * BLOCK - 1);
    Beam b;
    b.ox_lo = fma(cx, rays->step.x, lo.x); b.ox_hi = fma(cx, rays->step.x, hi.x);
    b.oy_lo = fma(cy, rays->step.y, lo.y); b.oy_hi = fma(cy, rays->step.y, hi.y);
    b.dx_lo = fma(cx, rays->step.z, lo.z); b.dx_hi = fma(cx, rays->step.z, hi.z);
    b.dy_lo = fma(cy, rays->step.w, lo.w); b.dy_hi = fma(cy, rays->step.w, hi.w);
    b.hx = extent * rays->step.x; b.gx = extent * rays->step.z;
    b.hy = extent * rays->step.y; b.gy = extent * rays->step.w;
    return pad_beam(b);
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
    float z_far = FAR;
    while (walk.size) {
        list->count = 0;
        gather(bvh, &beam, z_far, &walk, list);
        z_far = 0.0f;
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            BlockState *state = work->block + block;
            if (state->z_far < 0.0f) continue;
            const Bundle bundle = block_bundle(rays, work, block);
            visit_block(bvh, &bundle, list, state, z + block * BLOCK_RAYS, ids + block * BLOCK_RAYS);
            z_far = max(z_far, state->z_far);
        }
    }
#endif
}

#endif
