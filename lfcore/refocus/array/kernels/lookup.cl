// Radiance along rays from the tiles of a camera array.  The float64 reference is
// tests/refocus/array_reference.py; names agree.
//
// HALF: the image holds 16-bit floats.

#define EDGE 1e-5f
#define NEAREST 1e6f

#if HALF
#define NUMBER half
#define TEXEL(image, index) vload_half(index, image)
#else
#define NUMBER float
#define TEXEL(image, index) image[index]
#endif

inline float3 to_array(const View *view, float3 v)
{
    return (float3)(
        view->rotation[0] * v.x + view->rotation[1] * v.y + view->rotation[2] * v.z,
        view->rotation[3] * v.x + view->rotation[4] * v.y + view->rotation[5] * v.z,
        view->rotation[6] * v.x + view->rotation[7] * v.y + view->rotation[8] * v.z);
}

inline float3 view_position(const View *view)
{
    return (float3)(view->position[0], view->position[1], view->position[2]);
}

// Direction of unit extent along the axis through a film position in pixels.
inline float3 view_direction(const View *view, float u, float v)
{
    const float x = (u - 0.5f * view->width) * view->pitch;
    const float y = (v - 0.5f * view->height) * view->pitch;
    return to_array(view, (float3)(x, y, 1.0f));
}

inline float map_lookup(
    global const float *map,
    const Surface *surface,
    float x,
    float y)
{
    const int w = surface->map_width, h = surface->map_height;
    const float px = clamp(x * w - 0.5f, 0.0f, (float)(w - 1));
    const float py = clamp(y * h - 0.5f, 0.0f, (float)(h - 1));
    const int i = min((int)px, max(w - 2, 0)), j = min((int)py, max(h - 2, 0));
    const int i1 = min(i + 1, w - 1), j1 = min(j + 1, h - 1);
    const float fx = px - i, fy = py - j;
    const float top = map[j * w + i] * (1.0f - fx) + map[j * w + i1] * fx;
    const float bottom = map[j1 * w + i] * (1.0f - fx) + map[j1 * w + i1] * fx;
    return top * (1.0f - fy) + bottom * fy;
}

// Inverse parameter of a ray's hit on the focal surface; u, v: film position in pixels.
inline float surface_inverse_depth(
    const Surface *surface,
    global const float *map,
    const View *view,
    float3 origin,
    float3 direction,
    float u,
    float v)
{
    if (surface->kind == DEPTH_MAP) {
        const float near = map_lookup(map, surface, u / view->width, v / view->height);
        const float3 axis = (float3)(view->rotation[2], view->rotation[5], view->rotation[8]);
        const float start = dot(origin - view_position(view), axis);
        const float forward = dot(direction, axis);
        return clamp(near * forward / fmax(1.0f - near * start, 1e-12f), 0.0f, NEAREST);
    }
    const float3 point = (float3)(surface->point[0], surface->point[1], surface->point[2]);
    const float3 offset = point - origin;
    if (surface->kind == PLANE) {
        const float3 normal =
            (float3)(surface->normal[0], surface->normal[1], surface->normal[2]);
        const float distance = dot(offset, normal);
        const float q = dot(direction, normal) / distance;
        return distance == 0.0f ? NEAREST : clamp(q, 0.0f, NEAREST);
    }
    const float square = dot(direction, direction);
    const float along = dot(offset, direction);
    const float root =
        fmax(along * along - square * (dot(offset, offset) - surface->radius * surface->radius),
             0.0f);
    const float far = along + sqrt(root);
    return far > 0.0f ? clamp(square / far, 0.0f, NEAREST) : 0.0f;
}

// Sum of radiance and weight.  Scalars and selects, no vectors and early returns: one compiler's
// whole-function vectoriser returned three lanes of four wrong with those.
typedef struct {
    float red;
    float green;
    float blue;
    float weight;
} Sum;

inline Sum sum_zero(void)
{
    const Sum sum = {0.0f, 0.0f, 0.0f, 0.0f};
    return sum;
}

// Add weight times the bilinear radiance of data camera (i, j), standing at (cx, cy, 0), towards
// the point origin + direction / q; nothing outside its picture.
inline void add_lookup(
    Sum *sum,
    float weight,
    global const NUMBER *image,
    const Array *array,
    int i,
    int j,
    float cx,
    float cy,
    float3 origin,
    float3 direction,
    float q)
{
    const int w = array->width, h = array->height;
    const float depth = origin.z * q + direction.z;
    const float scale = array->inv_pitch / (depth > 0.0f ? depth : 1.0f);
    const float shear = array->delta * array->inv_pitch;
    const float x = (direction.x + (origin.x - cx) * q) * scale + cx * shear;
    const float y = (direction.y + (origin.y - cy) * q) * scale + cy * shear;
    const float slack = EDGE * w;
    const bool seen =
        depth > 0.0f && fabs(x) <= 0.5f * w + slack && fabs(y) <= 0.5f * h + slack;
    const float share = seen ? weight : 0.0f;
    const float px = clamp((seen ? x : 0.0f) + 0.5f * (w - 1), 0.0f, (float)(w - 1));
    const float py = clamp((seen ? y : 0.0f) + 0.5f * (h - 1), 0.0f, (float)(h - 1));
    const int a = min((int)px, max(w - 2, 0)), b = min((int)py, max(h - 2, 0));
    const float fx = px - a, fy = py - b;
    const int stride = array->columns * w;
    const int left = 3 * ((j * h + b) * stride + i * w + a);
    const int right = left + (a + 1 < w ? 3 : 0);
    const int down = b + 1 < h ? 3 * stride : 0;
    const float w00 = share * (1.0f - fx) * (1.0f - fy), w10 = share * fx * (1.0f - fy);
    const float w01 = share * (1.0f - fx) * fy, w11 = share * fx * fy;
#define BLEND(c) \
    (w00 * TEXEL(image, left + c) + w10 * TEXEL(image, right + c) + \
     w01 * TEXEL(image, left + down + c) + w11 * TEXEL(image, right + down + c))
    sum->red += BLEND(0);
    sum->green += BLEND(1);
    sum->blue += BLEND(2);
#undef BLEND
    sum->weight += share;
}

inline bool within(float value, float low, float high, int count)
{
    const float slack = EDGE * (high - low);
    return count == 1 || (value >= low - slack && value <= high + slack);
}

// Interval of an increasing axis that holds value, and where in it from 0 to 1.
inline int interval(global const float *axis, int count, float value, float *share)
{
    if (count == 1) {
        *share = 0.0f;
        return 0;
    }
    const float guess = (value - axis[0]) / (axis[count - 1] - axis[0]) * (count - 1);
    int index = (int)clamp(guess, 0.0f, (float)(count - 2));
    while (index < count - 2 && axis[index + 1] <= value) {
        ++index;
    }
    while (index > 0 && axis[index] > value) {
        --index;
    }
    *share = clamp((value - axis[index]) / (axis[index + 1] - axis[index]), 0.0f, 1.0f);
    return index;
}

// The crossing of a ray with the camera plane; false outside the array.
inline bool crossing(
    const Array *array,
    float3 origin,
    float3 direction,
    float *s,
    float *t)
{
    const bool ahead = direction.z > 0.0f;
    const float travel = -origin.z / (ahead ? direction.z : 1.0f);
    *s = origin.x + travel * direction.x;
    *t = origin.y + travel * direction.y;
    return ahead && within(*s, array->low_x, array->high_x, array->columns) &&
           within(*t, array->low_y, array->high_y, array->rows);
}

// Radiance along a ray whose focal point is origin + direction / q; weight 0 when unknown, else 1.
inline Sum quadrilinear(
    global const NUMBER *image,
    const Array *array,
    global const float *columns,
    global const float *rows,
    float3 origin,
    float3 direction,
    float q)
{
    float s, t, fx, fy;
    const bool known = crossing(array, origin, direction, &s, &t);
    const int i = interval(columns, array->columns, known ? s : columns[0], &fx);
    const int j = interval(rows, array->rows, known ? t : rows[0], &fy);
    const int i1 = min(i + 1, array->columns - 1), j1 = min(j + 1, array->rows - 1);
    const float x0 = columns[i], x1 = columns[i1], y0 = rows[j], y1 = rows[j1];
    const float ex = 1.0f - fx, ey = known ? 1.0f - fy : 0.0f;
    fy = known ? fy : 0.0f;
    Sum sum = sum_zero();
    add_lookup(&sum, ex * ey, image, array, i, j, x0, y0, origin, direction, q);
    add_lookup(&sum, fx * ey, image, array, i1, j, x1, y0, origin, direction, q);
    add_lookup(&sum, ex * fy, image, array, i, j1, x0, y1, origin, direction, q);
    add_lookup(&sum, fx * fy, image, array, i1, j1, x1, y1, origin, direction, q);
    const bool any = sum.weight > 0.0f;
    const float scale = any ? 1.0f / sum.weight : 0.0f;
    sum.red *= scale;
    sum.green *= scale;
    sum.blue *= scale;
    sum.weight = any ? 1.0f : 0.0f;
    return sum;
}
