"""Other tracers and renderers of the same scenes; each reports why it cannot run."""
