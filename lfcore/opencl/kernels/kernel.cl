// The head of a kernel with work-groups of one work-item; the type hint keeps compilers from
// vectorising over work-items.
#pragma once
#define KERNEL_OF(type) \
    kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(type)))
