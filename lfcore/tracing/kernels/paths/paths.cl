// Paths: rays from the lens that surfaces reflect or let pass, one surface further at a time.
//
// A path splits at its first SPLITS events, so that a ray has at most BRANCHES.  At further events a
// path leaves volumes, or else follows the stronger ray, with the weight of both.  The surface after
// the last event is matt.
#pragma once
#include "camera_rays.cl"
#include "differentials.cl"
#include "events.cl"
#include "given_hits.cl"

enum { MIRRORED, PASSED };  // children of a path
#define BRANCHES (1 << SPLITS)
// The largest inverse depth at which something appears, in inverse depths of the first surface: rays
// near a focus of curved glass have any.
#define NEAREST 4.0f

// A path on its way from one surface to the next; its direction has unit length.
typedef struct {
    int events, hits;  // reflections and transmissions so far; and all surfaces
    int passes;        // whether it did not turn back at the last surface
    int media[2];      // materials of the volumes it is in, the last one first; -1: none
    int last[2];       // the triangles it met last; -1: none
    uint number[2];    // see numbers_of
    float spread, blur;  // of what rough mirrors show: tangent, and width at the origin
    float origin[3], direction[3], weight[3];
    float point[MOVES][3], turn[MOVES][3];  // see differentials.cl
} Path;

// What arrives along a branch: light, the inverse depth at which its strongest part appears, and the
// mean weight of rays that are not followed.
typedef struct { float light[3], inverse_depth, strength, cut; } Arrived;

// A worker's memory: the next hits of paths, as given rays; and the branches of BLOCK_RAYS rays.
typedef struct {
    float origin[3 * BLOCK_RAYS], direction[3 * BLOCK_RAYS], footprint[BLOCK_RAYS];
    RayHit hits[BLOCK_RAYS];
    int order[BLOCK_RAYS];                  // of the record of hits
    int lists[2][BRANCHES * BLOCK_RAYS];    // numbers of branches that go on, and will
    Path branch[BRANCHES * BLOCK_RAYS];
    Arrived own[BLOCK_RAYS];                // of first surfaces
    Arrived shown[BRANCHES * BLOCK_RAYS];
} PathMemory;

// Paths of a worker.
typedef struct {
    const Scene *scene;
    const Tree *tree;
    global const Hits *hits;
    global PathMemory *memory;
    global const int *lit;
    global const int *now;  // `count` branches, at most BLOCK_RAYS, that meet their next surfaces
    int count;
    global int *next;       // `going` branches that go on from there
    int going;
    global const int *known;  // triangles of first hits, whose own light is known, too; or 0
    PathArguments numbers;
    float pixel_pitch;
} Paths;

// Begin the paths of `count` rays from the lens, from (s, t, 0) in direction (x, y, 1).
inline void begin_paths(global PathMemory *m, global const float *origins,
                        global const float *directions, int count, const PathArguments *n)
{
    for (int ray = 0; ray < count; ++ray) {
        const int number = m->lists[0][ray] = BRANCHES * ray;
        const float3 d = vload3(ray, directions);
        const float inverse = 1.0f / sqrt(inner_product(d, d));
        const float3 unit = d * inverse;
        global Path *path = m->branch + number;
        *path = (Path){.media = {-1, -1}, .last = {-1, -1}, .weight = {1, 1, 1},
                       .point = {{1, 0, 0}, {0, 1, 0}}};
        vstore3(vload3(ray, origins), 0, path->origin);
        vstore3(unit, 0, path->direction);
        vstore3(inverse * ((float3)(1, 0, 0) - unit.x * unit), 0, path->turn[2]);
        vstore3(inverse * ((float3)(0, 1, 0) - unit.y * unit), 0, path->turn[3]);
        if (ROUGH) vstore2(numbers_of(vload3(ray, origins), d, n), 0, path->number);
        m->own[ray] = (Arrived){.strength = 0.0f};
        for (int k = 0; k < BRANCHES; ++k) m->shown[number + k] = (Arrived){.strength = 0.0f};
    }
}

// The width of a pixel across a ray, at a distance.
inline float width_at(global const Path *path, float distance, float pixel_pitch)
{
    const float3 x = vload3(0, path->point[2]) + distance * vload3(0, path->turn[2]);
    const float3 y = vload3(0, path->point[3]) + distance * vload3(0, path->turn[3]);
    const float area = fabs(inner_product(cross_product(x, y), vload3(0, path->direction)));
    if (!ROUGH || path->spread == 0.0f) return pixel_pitch * sqrt(area);
    const float blur = fma(path->spread, distance, path->blur);
    return sqrt(fma(pixel_pitch * pixel_pitch, area, blur * blur));
}

inline Hit hit_of(const Paths *p, global const Path *path)
{
    Start start = {p->scene, vload3(0, path->direction), path->passes, path->last[0],
                   path->last[1]};
    return next_hit(p->tree, vload3(0, path->origin), &start);
}

// The hit of a first ray with the triangle that it is known to hit.
inline Hit known_hit(const Paths *p, global const Path *path, int triangle)
{
    int exponent;
    const Ray r = scaled_ray(vload3(0, path->origin), vload3(0, path->direction), &exponent);
    const Beside b = triangle_beside(&r, p->scene->corners + 9 * (long)triangle, 1);
    Hit hit = {0.0f, triangle};
    if (!meets_plane(&r, &b, &hit.t, &hit.weights)) return hit_of(p, path);
    hit.t = times_power((float3)(hit.t), -exponent).x;
    return hit;
}

inline void find_next_hits(const Paths *p)
{
    global PathMemory *m = p->memory;
    for (int at = 0; at < p->count; ++at) {
        global const Path *path = m->branch + p->now[at];
        const Hit hit = p->known ? known_hit(p, path, p->known[at]) : hit_of(p, path);
        vstore3(vload3(0, path->origin), at, m->origin);
        vstore3(vload3(0, path->direction), at, m->direction);
        vstore3(hit.weights, 0, m->hits[at].weights);
        m->hits[at].triangle = hit.id;
        m->hits[at].distance = hit.t;
        m->footprint[at] = hit.id < 0 ? 0.0f : width_at(path, hit.t, p->pixel_pitch);
    }
}

// A row of paths at their next hits.
typedef struct {
    Vec direction, weight;
    vf distance;
    Vec corner[3], weights, plane;  // of triangles, and unit normals on the side of the ray
    vi front, events, hits, triangle, last;
    Media media;
    Differentials moves;
    int branch[LANES];  // their numbers
    vf number[2], spread, blur;  // ROUGH: the numbers are from 0 to 1, the rest as in Path
} PathRow;

inline void set_lane(vf *row, int k, float x) { ((float *)row)[k] = x; }

// Read the row of the record from `at` on.
inline void read_paths(const Paths *p, int at, PathRow *r)
{
    private int events[LANES], hits[LANES], last[LANES], media[2][LANES];
    for (int k = 0; k < LANES; ++k) {
        const int place = min(p->memory->order[at + k], p->count - 1);
        global const Path *path = p->memory->branch + (r->branch[k] = p->now[place]);
        set_ray_vector(&r->direction, k, vload3(0, path->direction));
        set_ray_vector(&r->weight, k, vload3(0, path->weight));
        for (int j = 0; j < MOVES; ++j) {
            set_ray_vector(r->moves.point + j, k, vload3(0, path->point[j]));
            set_ray_vector(r->moves.turn + j, k, vload3(0, path->turn[j]));
        }
        set_ray_vector(&r->weights, k, vload3(0, p->memory->hits[place].weights));
        set_lane(&r->distance, k, p->memory->hits[place].distance);
        events[k] = path->events;
        hits[k] = path->hits;
        last[k] = path->last[0];
        media[0][k] = path->media[0];
        media[1][k] = path->media[1];
        for (int j = 0; ROUGH && j < 2; ++j)
            set_lane(r->number + j, k, (path->number[j] >> 8) * 0x1p-24f);
        if (ROUGH) set_lane(&r->spread, k, path->spread);
        if (ROUGH) set_lane(&r->blur, k, path->blur);
    }
    r->events = VLOAD(events);
    r->hits = VLOAD(hits);
    r->last = VLOAD(last);
    r->media = (Media){VLOAD(media[0]), VLOAD(media[1])};
}

// Move a row of paths to the triangles that they hit, through what absorbs light on the way.
inline void reach_surfaces(const Paths *p, int at, vi mine, PathRow *r, TriangleRow *triangles)
{
    private int media[LANES];
    private float absorbed[3][LANES], distance[LANES];
    VSTORE(r->media.first, media);
    VSTORE(r->distance, distance);
    r->triangle = VLOAD(p->hits->triangle + at);
    for (int k = 0; k < LANES; ++k) {
        const float3 a = media[k] < 0 ? 0.0f : vload3(0, p->scene->materials[media[k]].absorption);
        for (int j = 0; j < 3; ++j) absorbed[j][k] = -LOG2_E * axis(a, j) * max(distance[k], 0.0f);
    }
    const Vec kept = {exp2_fast(VLOAD(absorbed[0])), exp2_fast(VLOAD(absorbed[1])),
                      exp2_fast(VLOAD(absorbed[2]))};
    r->weight = times3(r->weight, kept);
    const Vec n = read_planes(p->scene, p->hits, at, mine, triangles, r->corner);
    r->front = LT(dot3(n, r->direction), (vf)(0.0f));
    r->plane = turn_vectors(n, ~r->front & (vi)(0x80000000));
    move_on(&r->moves, r->distance, r->direction, r->plane);
    if (ROUGH) r->blur = fma(r->spread, r->distance, r->blur);
}

// Light arrives at the rays in `mask`; a share of theirs ends here.
inline void arrive(const Paths *p, const PathRow *r, vi mask, Vec light, Vec share, vf cut,
                   int beyond)
{
    const Vec all = times3(r->weight, light), ends = times3(r->weight, share);
    const vf depth = apparent_depth(&r->moves, r->direction, beyond);
    const vf strength = (ends.x + ends.y + ends.z) * (1.0f / 3.0f);
    private int events[LANES];
    private float depths[LANES], strengths[LANES], cuts[LANES];
    VSTORE(r->events, events);
    VSTORE(depth, depths);
    VSTORE(strength, strengths);
    VSTORE(cut, cuts);
    for (uint left = row_bits(mask); left; left &= left - 1) {
        const uint k = lowest(left);
        const int branch = r->branch[k], first = events[k] == 0;
        global Arrived *to = first ? p->memory->own + branch / BRANCHES : p->memory->shown + branch;
        vstore3(vload3(0, to->light) + ray_vector(&all, k), 0, to->light);
        to->cut += cuts[k];
        if (strengths[k] < to->strength || !(strengths[k] > 0.0f || first)) continue;
        to->strength = strengths[k];
        to->inverse_depth = depths[k];
    }
}

// Send the rays in `mask` on, from hit points that begin at ray `at` of the record; rays that pass
// are branches of their own at the first events.
inline void send_on(Paths *p, const PathRow *r, vi mask, int way, int at, int event,
                    Vec direction, Vec weight, Media media, const Differentials *moves)
{
    private int events[LANES], hits[LANES], triangle[LANES], last[LANES], media_[2][LANES];
    VSTORE(r->events, events);
    VSTORE(r->hits, hits);
    VSTORE(r->triangle, triangle);
    VSTORE(r->last, last);
    VSTORE(media.first, media_[0]);
    VSTORE(media.second, media_[1]);
    const Vec point = load3(p->hits->point, at);
    for (uint left = row_bits(mask); left; left &= left - 1) {
        const uint k = lowest(left);
        const int splits = way == PASSED && event && events[k] < SPLITS;
        const int branch = r->branch[k] + (splits ? 1 << events[k] : 0);
        global Path *to = p->memory->branch + branch;
        p->next[p->going++] = branch;
        to->events = events[k] + event;
        to->hits = hits[k] + 1;
        to->passes = way == PASSED;
        to->media[0] = media_[0][k];
        to->media[1] = media_[1][k];
        to->last[0] = triangle[k];
        to->last[1] = last[k];
        for (int j = 0; ROUGH && j < 2; ++j)
            to->number[j] = p->memory->branch[r->branch[k]].number[j] * (event ? 5u : 1u);
        to->spread = ROUGH ? ((const float *)&r->spread)[k] : 0.0f;
        to->blur = ROUGH ? ((const float *)&r->blur)[k] : 0.0f;
        vstore3(ray_vector(&point, k), 0, to->origin);
        vstore3(ray_vector(&direction, k), 0, to->direction);
        vstore3(ray_vector(&weight, k), 0, to->weight);
        for (int j = 0; j < MOVES; ++j) {
            vstore3(ray_vector(moves->point + j, k), 0, to->point[j]);
            vstore3(ray_vector(moves->turn + j, k), 0, to->turn[j]);
        }
    }
}

// The mirrored rays in `mask`.  A smooth normal may send a ray into the triangle that it came
// from: the flat one does not.
inline void send_mirrored(Paths *p, const PathRow *r, vi mask, int at, Vec normal,
                          const Vec *bends, Vec weight)
{
    const Vec d = r->direction;
    const vi inward = LE(dot3(fma3(-2.0f * dot3(d, normal), normal, d), r->plane), (vf)(0.0f));
    Vec bent[MOVES];
    for (int k = 0; k < MOVES; ++k) bent[k] = pick3(bends[k], spread3(0.0f), inward);
    normal = pick3(normal, r->plane, inward);
    Differentials moves = r->moves;
    mirror_moves(&moves, d, normal, bent);
    const Vec mirrored = fma3(-2.0f * dot3(d, normal), normal, d);
    send_on(p, r, mask, MIRRORED, at, 1, directions_of(mirrored), weight, r->media, &moves);
}

inline Vec refracted(Vec d, Vec normal, vf eta)
{
    const vf cosine = -dot3(d, normal);
    const vf behind = sqrt(max(1.0f - eta * eta * (1.0f - cosine * cosine), (vf)(0.0f)));
    return fma3(eta * cosine - behind, normal, scale3(d, eta));
}

// The rays in `mask` that pass, refracted by `eta`.
inline void send_passed(Paths *p, const PathRow *r, vi mask, int at, Vec normal,
                        const Vec *bends, Vec weight, vf eta, Media media)
{
    const Vec d = r->direction;
    const vi outward = GE(dot3(refracted(d, normal, eta), r->plane), (vf)(0.0f));
    Vec bent[MOVES];
    for (int k = 0; k < MOVES; ++k) bent[k] = pick3(bends[k], spread3(0.0f), outward);
    normal = pick3(normal, r->plane, outward);
    Differentials moves = r->moves;
    refract_moves(&moves, d, normal, bent, eta);
    const Vec passed = pick3(directions_of(refracted(d, normal, eta)), d, EQ(eta, (vf)(1.0f)));
    send_on(p, r, mask, PASSED, at, 1, passed, weight, media, &moves);
}

// Send the idle rays on, straight.
inline void pass_idle(Paths *p, const PathRow *r, const Material *m, int material, int at,
                      vi idle)
{
    const vi onward = idle & LT(r->hits + 1, (vi)(MOST_HITS));
    const Media left = is_volume(m) ? without(r->media, material) : r->media;
    if (row_any(onward))
        send_on(p, r, onward, PASSED, at, 0, r->direction, r->weight, left, &r->moves);
}

// The children of a row of paths: their weights, and masks of the rays that have them.
typedef struct {
    Vec weight[2];
    vi ends;          // rays whose children are not followed: theirs were the most events
    vi on;            // rays that have a child
    vi child[2];      // rays that have this child
    vf cut;           // mean weight of what is not followed
} Children;

inline Children choose_children(const Paths *p, const PathRow *r, const Events *e, int volume,
                                vi mine)
{
    Children c = {.weight = {times3(r->weight, e->mirrored), times3(r->weight, e->passed)}};
    const vf mirrored = mean_of(c.weight[MIRRORED]), passed = mean_of(c.weight[PASSED]);
    c.ends = e->goes_on & GE(r->events, (vi)(p->numbers.most_events));
    c.on = mine & e->goes_on & ~c.ends;
    // Rays with one child, which has the weight of both; and those of them whose child passes:
    // rays that leave a volume, and those that pass more strongly.
    const vi single = GE(r->events, (vi)(SPLITS));
    const vi leaving = ~r->front & GT(passed, (vf)(0.0f)) & all_if(volume);
    const vi passing = GT(passed, mirrored) | leaving;
    c.child[MIRRORED] = c.on & GT(mirrored, (vf)(0.0f)) & ~(single & passing);
    c.child[PASSED] = c.on & GT(passed, (vf)(0.0f)) & (~single | passing);
    c.cut = pick((vf)(0.0f), pick(passed, mirrored, passing), single & c.on);
    c.cut = pick(c.cut, mirrored + passed, c.ends);
    const Vec both = plus3(c.weight[MIRRORED], c.weight[PASSED]);
    for (int way = MIRRORED; way <= PASSED; ++way) c.weight[way] = pick3(c.weight[way], both, single);
    return c;
}

// Let the rays `mine` of a row meet surfaces of one material, number `material`.
inline void meet_row(Paths *p, int material, int at, vi mine, Surface *s)
{
    PathRow r;
    TriangleRow triangles;
    read_paths(p, at, &r);
    reach_surfaces(p, at, mine, &r, &triangles);
    read_surface(p->scene, p->hits, at, s);
    const vf opacity = opacity_row(&p->tree->alpha_tests, p->hits, s->material, at);
    const vi idle = find_idle(r.front, r.media, s->material, material, opacity);
    pass_idle(p, &r, s->material, material, at, mine & idle);
    const int volume = is_volume(s->material);
    Events e = find_events(p->scene, material, opacity, r.media, r.front, s);
    const Vec white = spread3(1.0f), kept = minus3(white, plus3(e.mirrored, e.passed));
    Vec normal = s->normal;
    const vf spread = ROUGH ? meet_facets(s, r.number, &e, &normal) : (vf)(0.0f);
    const Children c = choose_children(p, &r, &e, volume, mine & ~idle);
    const Vec light = p->known ? spread3(0.0f) : shared_light(p->scene, s, p->lit, at, e.own, c.on);
    arrive(p, &r, mine & ~idle, light, pick3(white, kept, c.on), c.cut, 0);
    if (!row_any(c.on)) return;
    Vec bends[MOVES];
    find_bends(p->scene, &triangles, r.corner, r.weights, s->normal, &r.moves, bends);
    if (row_any(c.child[PASSED]))
        send_passed(p, &r, c.child[PASSED], at, s->normal, bends, c.weight[PASSED],
                    volume ? e.eta : (vf)(1.0f), e.behind);
    if (ROUGH) r.spread = sqrt(fma(spread, spread, r.spread * r.spread));
    if (row_any(c.child[MIRRORED]))
        send_mirrored(p, &r, c.child[MIRRORED], at, normal, bends, c.weight[MIRRORED]);
}

// The light of the background or of the sky arrives at rays that miss.
inline void arrive_beyond(const Paths *p)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi inside = LT(VLOAD(p->memory->order + at), (vi)(p->count));
        const vi missed = inside & LT(VLOAD(p->hits->key + at), (vi)(0));
        if (!row_any(missed)) continue;
        PathRow r;
        read_paths(p, at, &r);
        Vec light = spread3(vload3(0, p->scene->numbers->background));
        if (SKY) light = sky_row(p->scene, r.direction, row_bits(missed));
        if (SKY && ROUGH) blur_sky(p->scene, r.direction, r.spread, row_bits(missed), &light);
        arrive(p, &r, missed, light, spread3(1.0f), (vf)(0.0f), 1);
    }
}

inline void meet_surfaces(Paths *p)
{
    arrive_beyond(p);
    for (int k = 0; k < p->hits->key_count; ++k) {
        const int key = p->hits->keys[k];
        global const MaterialRecord *record = p->scene->materials + key / MIP_LEVELS;
        Material material = {*record};
        if (TEXTURED) read_maps(p->scene, record, key % MIP_LEVELS, material.maps);
        Surface s;
        s.material = &material;
        for (int at = 0; at < BLOCK_RAYS; at += LANES) {
            const vi mine = EQ(VLOAD(p->hits->key + at), (vi)(key));
            if (row_any(mine)) meet_row(p, key / MIP_LEVELS, at, mine, &s);
        }
    }
}

// A depth from its inverse; infinity for what is not in front.
inline float depth_of(float inverse, float most)
{
    return 1.0f / (inverse > 0.0f ? min(inverse, most) : 0.0f);
}

// Write what `count` rays see.
inline void write_seen(global const PathMemory *m, int count, global Seen *seen)
{
    for (int ray = 0; ray < count; ++ray) {
        const Arrived own = m->own[ray];
        const float most = own.inverse_depth > 0.0f ? NEAREST * own.inverse_depth : FAR;
        float3 light = 0.0f;
        float strongest = 0.0f, inverse = 0.0f, cut = own.cut;
        for (int k = 0; k < BRANCHES; ++k) {
            const Arrived part = m->shown[BRANCHES * ray + k];
            light += vload3(0, part.light);
            cut += part.cut;
            if (part.strength <= strongest) continue;
            strongest = part.strength;
            inverse = part.inverse_depth;
        }
        global Seen *to = seen + ray;
        vstore3(vload3(0, own.light), 0, to->own);
        vstore3(light, 0, to->specular);
        to->own_depth = depth_of(own.inverse_depth, FAR);
        to->specular_depth = strongest > 0.0f ? depth_of(inverse, min(most, FAR)) : 0.0f;
        to->cut = cut;
    }
}
