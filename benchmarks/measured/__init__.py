"""The measurements of tracer.py and store.py: sampled rays, our own methods, a module per mode."""
