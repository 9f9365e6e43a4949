// The kernels: each traces one packet after the other into a sink.
//
// A program has one SINK.  Of bundles, HITS writes triangles and depths, IMAGE radiance and
// optionally depths, SURFACE what surfaces emit and reflect, and normals.  Of rays given one by one,
// GIVEN writes hits; GIVEN_LIGHT and GIVEN_SURFACE read hits and write radiance, or surfaces.  PATHS
// follows paths to their next surfaces.
#include "block_hits.cl"
#include "shadows.cl"
#include "arrays.cl"
#if SINK == PATHS
#include "paths.cl"
#elif SPECULAR
#include "events.cl"
#endif

// A worker's memory; what tints_of describes follows.
typedef struct {
    float shaded[SHADED * COLOURS];
    Hits hits;
    ShadowMemory shadows;
#if SINK < GIVEN
    VisibilityMemory visibility;
    Region regions[BLOCK_RAYS];
    PlaneEquations equations[BLOCK_RAYS];
#elif SINK == PATHS
    PathMemory paths;
#else
    int order[BLOCK_RAYS];
#endif
} Memory;

// Words of a worker's memory, with what follows.
#define SCRATCH_WORDS(lights) \
    (sizeof(Memory) / 4 + (ulong)(lights) * (BLOCK + (CLEAR ? COLOURS : 0)))

// What the lights reach: see find_lit.
inline global int *lit_of(global Memory *m) { return (global int *)(m + 1); }

typedef struct {
    const Scene *scene;
    float pixel_pitch;  // tangent between neighbouring pixels
    global Memory *memory;
    Shadows shadows;
    const Arrays *out;
} Pipeline;

// Shade the record of hits; `bundle` as for find_lit.
inline void shade_record(Pipeline *p, const Bundle *bundle)
{
    global Memory *m = p->memory;
    global int *lit = lit_of(m);
    if (SHADOWS && m->hits.key_count)
        find_lit(&p->shadows, &m->hits, bundle, m->shadows.origins, lit);
    shade_hits(p->scene, &p->shadows.tree->alpha_tests, &m->hits, lit, m->shaded);
}

#if SINK < GIVEN
inline void take_packet(const Tree *tree, const Packet *packet, Pipeline *p)
{
    global Memory *m = p->memory;
    Visibility visibility = {.memory = &m->visibility};
    Block b = {.regions = {m->regions}, .equations = m->equations};
    find_visible(tree, packet, &visibility);
    for (int block = 0; block < packet->rays->blocks; ++block) {
        if (!has_block(packet, block)) continue;
        const Coverage *coverage = visibility.block + block;
        if (SINK != HITS) {
            b.bundle = block_bundle(packet, block);
            find_regions(coverage, block_inside(packet, block), &b.regions);
            find_block_hits(p->scene, p->pixel_pitch, &b, &m->hits);
            shade_record(p, &b.bundle);
        }
        write_arrays(packet, block, coverage, m->shaded, p->out);
    }
}
#elif SINK == PATHS
// Let the paths p->now meet their next surfaces.
inline void take_paths(Paths *paths, Pipeline *p)
{
    global Memory *m = p->memory;
    global PathMemory *found = &m->paths;
    find_next_hits(paths);
    const GivenRays rays = {.origin = found->origin, .direction = found->direction,
                            .hits = found->hits, .footprint = found->footprint};
    find_given_hits(p->scene, &rays, 0.0f, 0, paths->count, found->order, &m->hits);
    if (SHADOWS && m->hits.key_count && !paths->known)
        find_lit(&p->shadows, &m->hits, 0, m->shadows.origins, lit_of(m));
    meet_surfaces(paths);
}

// Follow `count` paths that have begun to their ends; `known` as in Paths.
inline void follow_paths(Paths *paths, int count, global const int *known, Pipeline *p)
{
    for (int step = 0; count; ++step, count = paths->going) {
        global int *now = paths->memory->lists[step % 2];
        paths->next = paths->memory->lists[(step + 1) % 2];
        paths->going = 0;
        for (int first = 0; first < count; first += BLOCK_RAYS) {
            paths->now = now + first;
            paths->count = min(count - first, BLOCK_RAYS);
            paths->known = step ? 0 : known;
            take_paths(paths, p);
        }
    }
}
#else

// Take given rays [first, end).
inline void take_given(const Tree *tree, const GivenRays *rays, int first, int end, Pipeline *p)
{
    if (SINK == GIVEN) {
        hit_given_rays(tree, rays, first, end);
        return;
    }
    global Memory *m = p->memory;
    find_given_hits(p->scene, rays, p->pixel_pitch, first, end, m->order, &m->hits);
    shade_record(p, 0);
    write_given(m->order, end, m->shaded, p->out);
}
#endif

// An array of the scene, in which `starts` counts lines.
#define ARRAY(name) ((global const void *)(scene + (ulong)LINE * starts->name))

inline Tree make_tree(global const uchar *scene, const SceneStarts *starts)
{
    return (Tree){.boxes = ARRAY(boxes), .children = ARRAY(children), .leaves = ARRAY(leaves),
                  .leaf_ids = ARRAY(leaf_ids),
                  .alpha_tests = {.record_of = ARRAY(alpha_test_of),
                                  .records = ARRAY(alpha_tests), .alpha = ARRAY(alpha)}};
}

inline Scene make_scene(global const uchar *scene, const SceneArguments *numbers)
{
    const SceneStarts *starts = &numbers->starts;
    return (Scene){.corners = ARRAY(corners), .attributes = ARRAY(attributes),
                   .material_ids = ARRAY(material_ids), .materials = ARRAY(materials),
                   .lights = ARRAY(lights), .mip_levels = ARRAY(mip_levels),
                   .texels = ARRAY(texels), .grids = ARRAY(grids),
                   .baked_light = ARRAY(baked_light), .sky = ARRAY(sky),
                   .numbers = numbers};
}

// The pipeline of this worker, and its memory in `scratch`.
inline Pipeline make_pipeline(const Tree *tree, const Scene *scene, float pixel_pitch,
                              global uint *scratch, const Arrays *out)
{
    const ulong words = SCRATCH_WORDS(scene->numbers->shadow_lights);
    global Memory *memory = (global Memory *)(scratch + get_global_id(0) * words);
    return (Pipeline){.scene = scene, .pixel_pitch = pixel_pitch, .memory = memory, .out = out,
                      .shadows = {.tree = tree, .scene = scene, .active = memory->shadows.active,
                                  .projected = memory->shadows.projected}};
}

// The rays [first, end) of a packet of rays that are given one by one.
typedef struct { int first, end; } Range;
inline Range rays_of(int packet, int count)
{
    const int first = packet * BLOCK_RAYS;
    return (Range){first, min(first + BLOCK_RAYS, count)};
}

// Workers take packets by `next_packet`, which counts from 0.
#if SINK < GIVEN
// `centre_rays` and `members`: see Rays.  Others are results, 0 where a sink has none.
KERNEL void trace_bundles(trace_bundles_PARAMETERS)
{
    const Tree tree = make_tree(scene, &scene_numbers.starts);
    const Scene surfaces = make_scene(scene, &scene_numbers);
    const Arrays arrays = {.triangle = triangle, .depth = depth, .across = ray_numbers.across,
                           .add = ray_numbers.add, .shaded = {radiance, albedo, normal}};
    Pipeline pipeline = make_pipeline(&tree, &surfaces, ray_numbers.pixel_pitch, scratch, &arrays);
    const Rays rays = make_rays(centre_rays, members, &ray_numbers);
    for (int number; (number = atomic_inc(next_packet)) < ray_numbers.packets;) {
        const Packet packet = make_packet(&rays, number);
        take_packet(&tree, &packet, &pipeline);
    }
}
#elif SINK == PATHS
KERNEL void trace_paths(trace_paths_PARAMETERS)
{
    const Tree tree = make_tree(scene, &scene_numbers.starts);
    const Scene surfaces = make_scene(scene, &scene_numbers);
    Pipeline pipeline = make_pipeline(&tree, &surfaces, ray_numbers.pixel_pitch, scratch, 0);
    global Memory *memory = pipeline.memory;
    Paths followed = {.scene = &surfaces, .tree = &tree, .hits = &memory->hits,
                      .memory = &memory->paths, .lit = lit_of(memory), .numbers = path_numbers,
                      .pixel_pitch = pipeline.pixel_pitch};
    for (int number; (number = atomic_inc(next_packet)) < ray_numbers.packets;) {
        const Range range = rays_of(number, ray_numbers.columns);
        const int first = range.first, count = range.end - first;
        begin_paths(&memory->paths, origins + 3 * first, directions + 3 * first, count,
                    &path_numbers);
        follow_paths(&followed, count, triangle ? triangle + first : 0, &pipeline);
        write_seen(&memory->paths, count, seen + first);
    }
}
#else
// GIVEN writes `hits`, which the other sinks read.
KERNEL void trace_given(trace_given_PARAMETERS)
{
    const Tree tree = make_tree(scene, &scene_numbers.starts);
    const Scene surfaces = make_scene(scene, &scene_numbers);
    const Arrays arrays = {.shaded = {radiance, albedo, normal}};
    Pipeline pipeline = make_pipeline(&tree, &surfaces, ray_numbers.pixel_pitch, scratch, &arrays);
    const GivenRays rays = {.origin = origins, .direction = directions, .hits = hits,
                            .footprint = footprints};
    for (int number; (number = atomic_inc(next_packet)) < ray_numbers.packets;) {
        const Range range = rays_of(number, ray_numbers.columns);
        take_given(&tree, &rays, range.first, range.end, &pipeline);
    }
}
#endif

kernel void scratch_words(const int lights, global int *words)
{
    *words = SINK == GIVEN ? 0 : SCRATCH_WORDS(lights);
}
