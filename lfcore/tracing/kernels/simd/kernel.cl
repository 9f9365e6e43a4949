// The head of a kernel whose work-groups are one work-item, over which the hint keeps compilers from vectorising.
#pragma once
#define KERNEL_OF(type) kernel __attribute__((reqd_work_group_size(1, 1, 1))) __attribute__((vec_type_hint(type)))
