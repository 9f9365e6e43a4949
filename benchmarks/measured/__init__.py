"""The measurements of tracer.py: sampled rays, our own methods, a module per mode."""
