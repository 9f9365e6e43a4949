// Paths: each meets its next surface, whose own light arrives, and which sends at most two rays on.
//
// A path splits at its first SPLITS events.  At further ones it leaves volumes, or else follows the
// stronger ray, with the weight of both.  The surface after the last event is matt.
#pragma once
#include "differentials.cl"
#include "events.cl"
#include "given_hits.cl"
#include "next_hit.cl"

enum { MIRRORED, PASSED, WAYS };  // children of a path

// A worker's memory: the next hits of a packet's paths, as given rays.
typedef struct {
    float origin[3 * BLOCK_RAYS], direction[3 * BLOCK_RAYS], footprint[BLOCK_RAYS];
    RayHit hits[BLOCK_RAYS];
    int order[BLOCK_RAYS];  // of the record of hits
} PathMemory;

// Paths [first, end), at most BLOCK_RAYS, and what becomes of them.
typedef struct {
    const Scene *scene;
    const Tree *tree;
    global const Hits *hits;
    global PathMemory *memory;
    global const int *lit;
    global Path *paths;
    global const int *chosen;   // (R,) of `paths`; 0: all
    global Path *children;      // (R, WAYS)
    global Arrived *arrived;    // (R,)
    int first, end;
    PathArguments numbers;
    float pixel_pitch;
} Paths;

inline global Path *path_of(const Paths *p, int ray)
{
    return p->paths + (p->chosen ? p->chosen[ray] : ray);
}

// Begin the paths of rays from the lens, from (s, t, 0) in direction (x, y, 1).
inline void begin_paths(const Paths *p, global const float *origins, global const float *directions)
{
    for (int ray = p->first; ray < p->end; ++ray) {
        const float3 d = vload3(ray, directions);
        const float inverse = 1.0f / sqrt(inner_product(d, d));
        const float3 unit = d * inverse;
        global Path *path = p->paths + ray;
        *path = (Path){.number = ray, .media = {-1, -1}, .last = {-1, -1}, .weight = {1, 1, 1},
                       .point = {{1, 0, 0}, {0, 1, 0}}};
        vstore3(vload3(ray, origins), 0, path->origin);
        vstore3(unit, 0, path->direction);
        vstore3(inverse * ((float3)(1, 0, 0) - unit.x * unit), 0, path->turn[2]);
        vstore3(inverse * ((float3)(0, 1, 0) - unit.y * unit), 0, path->turn[3]);
    }
}

// The width of a pixel across a ray, at a distance.
inline float width_at(global const Path *path, float distance, float pixel_pitch)
{
    const float3 x = vload3(0, path->point[2]) + distance * vload3(0, path->turn[2]);
    const float3 y = vload3(0, path->point[3]) + distance * vload3(0, path->turn[3]);
    return pixel_pitch * sqrt(fabs(inner_product(cross_product(x, y), vload3(0, path->direction))));
}

inline void find_next_hits(const Paths *p)
{
    global PathMemory *m = p->memory;
    for (int ray = p->first; ray < p->end; ++ray) {
        global const Path *path = path_of(p, ray);
        const int at = ray - p->first;
        const Hit hit = next_hit(p->tree, p->scene, path);
        vstore3(vload3(0, path->origin), at, m->origin);
        vstore3(vload3(0, path->direction), at, m->direction);
        vstore3(hit.weights, 0, m->hits[at].weights);
        m->hits[at].triangle = hit.id;
        m->hits[at].distance = hit.t;
        m->footprint[at] = hit.id < 0 ? 0.0f : width_at(path, hit.t, p->pixel_pitch);
        p->arrived[ray] = (Arrived){.strength = -1.0f};
        for (int way = 0; way < WAYS; ++way) p->children[WAYS * ray + way].number = -1;
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
    int ray[LANES];  // their numbers
} PathRow;

inline void set_lane(vf *row, int k, float x) { ((float *)row)[k] = x; }

// Read the row of the record from `at` on.
inline void read_paths(const Paths *p, int at, PathRow *r)
{
    private int events[LANES], hits[LANES], last[LANES], media[2][LANES];
    for (int k = 0; k < LANES; ++k) {
        const int place = min(p->memory->order[at + k], p->end - p->first - 1);
        global const Path *path = path_of(p, r->ray[k] = p->first + place);
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
    const int any = p->hits->triangle[at + lowest(row_bits(mine))];
    triangles->count = LANES;
    VSTORE(pick_int((vi)(any), r->triangle, mine), triangles->ids);
    for (int k = 0; k < LANES; ++k) {
        const float3 a = media[k] < 0 ? 0.0f : vload3(0, p->scene->materials[media[k]].absorption);
        for (int j = 0; j < 3; ++j) absorbed[j][k] = -LOG2_E * axis(a, j) * max(distance[k], 0.0f);
    }
    const Vec kept = {exp2_fast(VLOAD(absorbed[0])), exp2_fast(VLOAD(absorbed[1])),
                      exp2_fast(VLOAD(absorbed[2]))};
    r->weight = times3(r->weight, kept);
    read_corners(p->scene, triangles, r->corner);
    const Vec n = directions_of(cross3(minus3(r->corner[1], r->corner[0]),
                                       minus3(r->corner[2], r->corner[0])));
    r->front = LT(dot3(n, r->direction), (vf)(0.0f));
    r->plane = turn_vectors(n, ~r->front & (vi)(0x80000000));
    move_on(&r->moves, r->distance, r->direction, r->plane);
}

// Light arrives at the rays in `mask`; a share of theirs ends here.
inline void arrive(const Paths *p, const PathRow *r, vi mask, Vec light, Vec share, vf cut,
                   int beyond)
{
    const Vec all = times3(r->weight, light), ends = times3(r->weight, share);
    const vf depth = apparent_depth(&r->moves, r->direction, beyond);
    const vf strength = (ends.x + ends.y + ends.z) * (1.0f / 3.0f);
    private float depths[LANES], strengths[LANES], cuts[LANES];
    VSTORE(depth, depths);
    VSTORE(strength, strengths);
    VSTORE(cut, cuts);
    for (uint left = row_bits(mask); left; left &= left - 1) {
        const uint k = lowest(left);
        global Arrived *to = p->arrived + r->ray[k];
        vstore3(ray_vector(&all, k), 0, to->light);
        to->inverse_depth = depths[k];
        to->strength = strengths[k];
        to->cut = cuts[k];
    }
}

// Send the rays in `mask` on, from hit points that begin at ray `at` of the record.
inline void send_on(const Paths *p, const PathRow *r, vi mask, int way, int at, int event,
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
        global Path *to = p->children + WAYS * (long)r->ray[k] + way;
        to->number = path_of(p, r->ray[k])->number;
        to->events = events[k] + event;
        to->hits = hits[k] + 1;
        to->passes = way == PASSED;
        to->media[0] = media_[0][k];
        to->media[1] = media_[1][k];
        to->last[0] = triangle[k];
        to->last[1] = last[k];
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
inline void send_mirrored(const Paths *p, const PathRow *r, vi mask, int at, Vec normal,
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
inline void send_passed(const Paths *p, const PathRow *r, vi mask, int at, Vec normal,
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

// The share of light that meets the surfaces of a row.
inline vf opacity_row(const Paths *p, const Material *m, int at)
{
    private float opacity[LANES];
    for (int k = 0; k < LANES; ++k) {
        const int id = p->hits->triangle[at + k];
        opacity[k] = m->record.opacity;
        const AlphaTests *tests = &p->tree->alpha_tests;
        // A row may have rays of other materials, whose triangles have no picture of alpha.
        if (!m->record.alpha_blend || id < 0 || !has_holes(tests, id)) continue;
        global const AlphaTest *image = tests->records + tests->record_of[id];
        opacity[k] *= alpha_at(tests->alpha, image, p->hits->value[COORDINATES][at + k],
                               p->hits->value[COORDINATES + 1][at + k]) / 255.0f;
    }
    return VLOAD(opacity);
}

inline vf mean_of(Vec a) { return (a.x + a.y + a.z) * (1.0f / 3.0f); }

inline vi all_if(int condition) { return (vi)(condition ? -1 : 0); }

// Which rays pass a surface as if it were not there: where it is a hole, and where they leave a
// volume that they are not in first.
inline vi find_idle(const PathRow *r, const Material *m, int material, vf opacity)
{
    const vi foreign = ~r->front & ~EQ(r->media.first, (vi)(material));
    return (foreign & all_if(is_volume(m))) | EQ(opacity, (vf)(0.0f));
}

// Send the idle rays on, straight.
inline void pass_idle(const Paths *p, const PathRow *r, const Material *m, int material, int at,
                      vi idle)
{
    const vi onward = idle & LT(r->hits + 1, (vi)(MOST_HITS));
    const Media left = is_volume(m) ? without(r->media, material) : r->media;
    if (row_any(onward))
        send_on(p, r, onward, PASSED, at, 0, r->direction, r->weight, left, &r->moves);
}

// The children of a row of paths: their weights, and masks of the rays that have them.
typedef struct {
    Vec weight[WAYS];
    vi ends;          // rays whose children are not followed: theirs were the most events
    vi on;            // rays that have a child
    vi child[WAYS];   // rays that have this child
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
    for (int way = 0; way < WAYS; ++way) c.weight[way] = pick3(c.weight[way], both, single);
    return c;
}

// Let the rays `mine` of a row meet surfaces of one material, number `material`.
inline void meet_row(const Paths *p, int material, int at, vi mine, Surface *s)
{
    PathRow r;
    TriangleRow triangles;
    read_paths(p, at, &r);
    reach_surfaces(p, at, mine, &r, &triangles);
    read_surface(p->scene, p->hits, at, s);
    const vf opacity = opacity_row(p, s->material, at);
    const vi idle = find_idle(&r, s->material, material, opacity);
    pass_idle(p, &r, s->material, material, at, mine & idle);
    const int volume = is_volume(s->material);
    const Events e = find_events(p->scene, material, opacity, r.media, r.front, s);
    const Children c = choose_children(p, &r, &e, volume, mine & ~idle);
    lack_nothing(~c.on, s);
    const Vec light = scale3(own_light(p->scene, s, p->lit, at), pick((vf)(1.0f), e.own, c.on));
    const Vec white = spread3(1.0f), kept = minus3(white, plus3(e.mirrored, e.passed));
    arrive(p, &r, mine & ~idle, light, pick3(white, kept, c.on), c.cut, 0);
    if (!row_any(c.on)) return;
    Vec bends[MOVES];
    find_bends(p->scene, &triangles, r.corner, r.weights, s->normal, &r.moves, bends);
    if (row_any(c.child[MIRRORED]))
        send_mirrored(p, &r, c.child[MIRRORED], at, s->normal, bends, c.weight[MIRRORED]);
    if (row_any(c.child[PASSED]))
        send_passed(p, &r, c.child[PASSED], at, s->normal, bends, c.weight[PASSED],
                    volume ? e.eta : (vf)(1.0f), e.behind);
}

// The light of the background or of the sky arrives at rays that miss.
inline void arrive_beyond(const Paths *p)
{
    for (int at = 0; at < BLOCK_RAYS; at += LANES) {
        const vi inside = LT(VLOAD(p->memory->order + at), (vi)(p->end - p->first));
        const vi missed = inside & LT(VLOAD(p->hits->key + at), (vi)(0));
        if (!row_any(missed)) continue;
        PathRow r;
        read_paths(p, at, &r);
        Vec light = spread3(vload3(0, p->scene->numbers->background));
        if (SKY) light = sky_row(p->scene, r.direction, row_bits(missed));
        arrive(p, &r, missed, light, spread3(1.0f), (vf)(0.0f), 1);
    }
}

inline void meet_surfaces(const Paths *p)
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
