// Visibility alone: the closest triangle and its depth for every ray of a job.
#include "beam.cl"

#define SCRATCH_FLOATS (2 * BEAM_BLOCKS * BLOCK_RAYS + 7 * LIST)

// Write what a block saw, its rays of one element and one row of the inner grid at a time.
inline void write_hits(const Rays *rays, const BeamWork *work, int block, global const float *z, global const int *ids,
                       global float *depth, global int *triangle)
{
    const int2 where = block_position(work, block);
    for (int at = 0; at < BLOCK_RAYS; at += INNER) {
        const int y = where.y + at / BLOCK % INNER, element = block_element(work, block, at % BLOCK / INNER, at / BLOCK / INNER);
        if (element < 0 || y >= rays->rows) continue;
        const ulong to = ((ulong)element * rays->rows + y) * rays->columns + where.x;
        if (where.x + INNER <= rays->columns) {
            JOIN(vstore, INNER)(JOIN(vload, INNER)(0, z + at), 0, depth + to);
            JOIN(vstore, INNER)(JOIN(vload, INNER)(0, ids + at), 0, triangle + to);
        } else
            for (int k = 0; where.x + k < rays->columns; ++k) {
                depth[to + k] = z[at + k];
                triangle[to + k] = ids[at + k];
            }
    }
}

kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))
void slab_hits(BVH_PARAMETERS,
               RAYS_PARAMETERS,
               global int *restrict next,      // (1,) the next beam to take
               global float *restrict scratch, // (workers, SCRATCH_FLOATS)
               global float *restrict depth,   // (E, rows, columns)
               global int *restrict triangle)  // (E, rows, columns)
{
    const Bvh bvh = MAKE_BVH;
    const Rays rays = MAKE_RAYS;
    global float *z = scratch + get_global_id(0) * (ulong)SCRATCH_FLOATS;
    global int *ids = (global int *)(z + BEAM_BLOCKS * BLOCK_RAYS);
    LeafList list = {(global float *)(ids + BEAM_BLOCKS * BLOCK_RAYS), 0, LIST, 0};
    list.leaf = (global int *)(list.boxes + 6 * LIST);
    BeamWork work;
    for (int beam = atomic_inc(next); beam < n_beams; beam = atomic_inc(next)) {
        start_beam(&rays, beam, &work);
        see(&bvh, &rays, &work, &list, z, ids);
        for (int block = 0; block < BEAM_BLOCKS; ++block) {
            if (work.block[block].z_far < 0.0f) continue;
            materialise(work.block + block, z + block * BLOCK_RAYS, ids + block * BLOCK_RAYS);
            if (WRITE) write_hits(&rays, &work, block, z + block * BLOCK_RAYS, ids + block * BLOCK_RAYS, depth, triangle);
        }
    }
}
