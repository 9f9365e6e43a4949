// What the kernels are given, and how large it is, for the host to check its own layouts against.
#ifndef LFCORE_ARGUMENTS_CL
#define LFCORE_ARGUMENTS_CL

#define KERNEL \
    kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(LANES_TYPE)))

#endif
