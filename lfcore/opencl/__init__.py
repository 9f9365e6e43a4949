"""OpenCL drivers, device choice, program build and specialisation."""
