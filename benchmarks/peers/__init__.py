"""Other tracers with the same triangles: each is a :class:`Method`, or says why it cannot run."""
