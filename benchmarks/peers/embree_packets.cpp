// Embree's 16-wide coherent packets on the rays of a light slab.
//
//     embree_packets TRIANGLES.bin
//
// TRIANGLES.bin is (T, 3, 3) float32.  Then, one a line on standard input:
//     rays FILE THREADS WAY   FILE: N, P, side as int32, delta, lens positions (N), tangents (P, 2), float32;
//                             WAY: lens or pixels
//     run                     prints: wall seconds, CPU seconds, hits, sum of depths
// Ray (i, j) of pixel p: O = (s_i, t_j, 0), D = (x_p - s_i delta, y_p - t_j delta, 1).  The pixels are squares of
// side x side, row after row.  A packet is 4 x 4 neighbouring lens samples of one pixel, or 4 x 4 neighbouring pixels
// through one lens sample; packets follow each other along the rows of what they do not hold.
#include <embree3/rtcore.h>
#include <pmmintrin.h>
#include <xmmintrin.h>

#include <atomic>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <limits>
#include <thread>
#include <vector>

static std::vector<float> read_floats(FILE *file, size_t count)
{
    std::vector<float> values(count);
    if (fread(values.data(), sizeof(float), count, file) != count) {
        fprintf(stderr, "embree_packets: a file is too short\n");
        exit(1);
    }
    return values;
}

struct Rays {
    int32_t views = 0, pixels = 0, side = 1, threads = 1;
    bool by_pixels = false;
    float delta = 0.0f;
    std::vector<float> lens, tangents;
};

static Rays read_rays(const char *path, int threads, bool by_pixels)
{
    FILE *file = fopen(path, "rb");
    Rays rays;
    int32_t head[3];
    if (!file || fread(head, 4, 3, file) != 3) {
        fprintf(stderr, "embree_packets: cannot read %s\n", path);
        exit(1);
    }
    rays.views = head[0];
    rays.pixels = head[1];
    rays.side = head[2];
    rays.by_pixels = by_pixels;
    rays.delta = read_floats(file, 1)[0];
    rays.lens = read_floats(file, rays.views);
    rays.tangents = read_floats(file, 2 * size_t(rays.pixels));
    rays.threads = threads;
    fclose(file);
    return rays;
}

struct Total {
    uint64_t hits = 0;
    double depth = 0.0;
};

// Ray k of a packet is that of a pixel and a lens sample.
struct Places {
    int pixel[16], column[16], row[16];
};

static void trace_packet(RTCScene scene, RTCIntersectContext *context, const Rays &rays, const Places &at, Total *total)
{
    alignas(64) int valid[16];
    alignas(64) RTCRayHit16 packet;
    for (int k = 0; k < 16; ++k) {
        const int i = at.column[k], j = at.row[k];
        const bool inside = i < rays.views && j < rays.views;
        const float s = rays.lens[inside ? i : 0], t = rays.lens[inside ? j : 0];
        const float *tangent = &rays.tangents[2 * size_t(at.pixel[k])];
        valid[k] = inside ? -1 : 0;
        packet.ray.org_x[k] = s;
        packet.ray.org_y[k] = t;
        packet.ray.org_z[k] = 0.0f;
        packet.ray.dir_x[k] = tangent[0] - s * rays.delta;
        packet.ray.dir_y[k] = tangent[1] - t * rays.delta;
        packet.ray.dir_z[k] = 1.0f;
        packet.ray.tnear[k] = 0.0f;
        packet.ray.tfar[k] = std::numeric_limits<float>::infinity();
        packet.ray.time[k] = 0.0f;
        packet.ray.mask[k] = 0xffffffffu;
        packet.ray.id[k] = 0;
        packet.ray.flags[k] = 0;
        packet.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;
        packet.hit.instID[0][k] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect16(valid, scene, context, &packet);
    float depth = 0.0f;
    int hits = 0;
    for (int k = 0; k < 16; ++k) {
        const bool hit = valid[k] && packet.hit.geomID[k] != RTC_INVALID_GEOMETRY_ID;
        hits += hit;
        depth += hit ? packet.ray.tfar[k] : 0.0f;
    }
    total->hits += hits;
    total->depth += depth;
}

// One pixel, 4 x 4 lens samples a packet.
static void trace_pixel(RTCScene scene, RTCIntersectContext *context, const Rays &rays, int pixel, Total *total)
{
    Places at;
    for (int row = 0; row < rays.views; row += 4)
        for (int column = 0; column < rays.views; column += 4) {
            for (int k = 0; k < 16; ++k) {
                at.pixel[k] = pixel;
                at.column[k] = column + (k & 3);
                at.row[k] = row + (k >> 2);
            }
            trace_packet(scene, context, rays, at, total);
        }
}

// 4 x 4 pixels, one lens sample a packet.
static void trace_group(RTCScene scene, RTCIntersectContext *context, const Rays &rays, int group, Total *total)
{
    const int across = rays.side / 4, square = group / (across * across), within = group % (across * across);
    const int first = (square * rays.side + within / across * 4) * rays.side + within % across * 4;
    Places at;
    for (int k = 0; k < 16; ++k) at.pixel[k] = first + (k >> 2) * rays.side + (k & 3);
    for (int row = 0; row < rays.views; ++row)
        for (int column = 0; column < rays.views; ++column) {
            for (int k = 0; k < 16; ++k) {
                at.column[k] = column;
                at.row[k] = row;
            }
            trace_packet(scene, context, rays, at, total);
        }
}

static void trace_items(RTCScene scene, const Rays &rays, std::atomic<int> *next, Total *total)
{
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    const auto trace = rays.by_pixels ? trace_group : trace_pixel;
    const int items = rays.by_pixels ? rays.pixels / 16 : rays.pixels;
    for (int item = (*next)++; item < items; item = (*next)++) trace(scene, &context, rays, item, total);
}

static double cpu_seconds()
{
    timespec now;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return now.tv_sec + 1e-9 * now.tv_nsec;
}

static void run(RTCScene scene, const Rays &rays)
{
    const auto begun = std::chrono::steady_clock::now();
    const double cpu = cpu_seconds();
    std::atomic<int> next(0);
    std::vector<Total> totals(rays.threads);
    std::vector<std::thread> threads;
    for (int k = 0; k < rays.threads; ++k) threads.emplace_back(trace_items, scene, std::cref(rays), &next, &totals[k]);
    for (auto &thread : threads) thread.join();
    const std::chrono::duration<double> wall = std::chrono::steady_clock::now() - begun;
    Total sum;
    for (const auto &total : totals) {
        sum.hits += total.hits;
        sum.depth += total.depth;
    }
    printf("%.9f %.9f %llu %.9g\n", wall.count(), cpu_seconds() - cpu, (unsigned long long)sum.hits, sum.depth);
    fflush(stdout);
}

static RTCScene build_scene(RTCDevice device, const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file) { fprintf(stderr, "embree_packets: cannot read %s\n", path); exit(1); }
    fseek(file, 0, SEEK_END);
    const size_t triangles = ftell(file) / 36;
    rewind(file);
    const std::vector<float> corners = read_floats(file, 9 * triangles);
    fclose(file);
    RTCGeometry mesh = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    void *vertices = rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, 3 * triangles);
    memcpy(vertices, corners.data(), corners.size() * sizeof(float));
    auto *index = (uint32_t *)rtcSetNewGeometryBuffer(mesh, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles);
    for (size_t k = 0; k < 3 * triangles; ++k) index[k] = uint32_t(k);
    rtcCommitGeometry(mesh);
    RTCScene scene = rtcNewScene(device);
    rtcAttachGeometry(scene, mesh);
    rtcReleaseGeometry(mesh);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcCommitScene(scene);
    return scene;
}

int main(int argc, char **argv)
{
    if (argc != 2) { fprintf(stderr, "usage: embree_packets TRIANGLES.bin\n"); return 1; }
    _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);
    _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON);
    RTCDevice device = rtcNewDevice("");
    const auto begun = std::chrono::steady_clock::now();
    RTCScene scene = build_scene(device, argv[1]);
    const std::chrono::duration<double> build = std::chrono::steady_clock::now() - begun;
    printf("%d %d %.6f\n", int(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_VERSION)),
           int(rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)), build.count());
    fflush(stdout);
    Rays rays;
    char word[8], path[4096], way[8];
    while (scanf("%7s", word) == 1) {
        if (!strcmp(word, "rays")) {
            int threads = 1;
            if (scanf("%4095s %d %7s", path, &threads, way) != 3) return 1;
            rays = read_rays(path, threads, !strcmp(way, "pixels"));
        } else if (!strcmp(word, "run")) {
            run(scene, rays);
        }
    }
    rtcReleaseScene(scene);
    rtcReleaseDevice(device);
    return 0;
}
