#include "lanes.cl"

kernel void round_all(global const float *x, global const float *y, global float *inverse,
                      global float *root, global float *quotient)
{
    const size_t at = get_global_id(0) * LANES;
    const vf a = VLOAD(x + at), b = VLOAD(y + at);
    VSTORE(reciprocal(a), inverse + at);
    VSTORE(sqrt(a), root + at);
    VSTORE(b / a, quotient + at);
}

kernel void multiply_add(global const float *x, global const float *y, global const float *z,
                         global float *product, global float *sum, global float *fused)
{
    const size_t at = get_global_id(0) * LANES;
    const vf a = VLOAD(x + at), b = VLOAD(y + at), c = VLOAD(z + at);
    VSTORE(a * b, product + at);
    VSTORE(a * b + c, sum + at);
    VSTORE(fma(a, b, c), fused + at);
}
