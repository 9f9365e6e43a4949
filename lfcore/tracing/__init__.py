"""What each ray meets: bounding volume hierarchy, kernels, host side."""
