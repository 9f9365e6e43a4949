"""Where rays run: thin lens, light slab, camera arrays, sensor planes, bundles."""
