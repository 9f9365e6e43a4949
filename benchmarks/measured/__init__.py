"""What benchmarks/tracer.py measures: the sampled rays, our own methods, one module a mode."""
