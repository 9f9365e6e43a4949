kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void chain(global float *x, const int count)
{
    float a = x[0], b = x[1];
    for (int k = 0; k < count; ++k) a = fma(a, b, 1.0f);
    x[2 + get_global_id(0)] = a;
}
kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void flops(global float *x, const int count)
{
    const float16 b = x[1];
    float16 a0 = x[0], a1 = a0 + 1, a2 = a0 + 2, a3 = a0 + 3, a4 = a0 + 4, a5 = a0 + 5;
    float16 a6 = a0 + 6, a7 = a0 + 7, a8 = a0 + 8, a9 = a0 + 9, aa = a0 + 10, ab = a0 + 11;
    for (int k = 0; k < count; ++k) {
        a0 = fma(a0, b, b); a1 = fma(a1, b, b); a2 = fma(a2, b, b); a3 = fma(a3, b, b);
        a4 = fma(a4, b, b); a5 = fma(a5, b, b); a6 = fma(a6, b, b); a7 = fma(a7, b, b);
        a8 = fma(a8, b, b); a9 = fma(a9, b, b); aa = fma(aa, b, b); ab = fma(ab, b, b);
    }
    const float16 s = a0 + a1 + a2 + a3 + a4 + a5 + a6 + a7 + a8 + a9 + aa + ab;
    x[2 + get_global_id(0)] = s.s0 + s.s5 + s.sf;
}
kernel __attribute__((reqd_work_group_size(1, 1, 1)))
void stream(global const float *restrict data, global float *x, const int words, const int times)
{
    global const float *at = data + get_global_id(0) * (ulong)words;
    float16 a = 0, b = 0, c = 0, d = 0;
    for (int k = 0; k < times; ++k)
        for (int i = 0; i < words; i += 64) {
            a += vload16(0, at + i); b += vload16(1, at + i);
            c += vload16(2, at + i); d += vload16(3, at + i);
        }
    const float16 s = a + b + c + d;
    x[2 + get_global_id(0)] = s.s0 + s.s3 + s.sf;
}
