"""Other tracers on the same triangles: each is a :class:`Method` or says why it cannot be one."""
