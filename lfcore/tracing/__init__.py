"""The tracer: bounding volume hierarchy, kernels, host side."""
