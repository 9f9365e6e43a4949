"""Light fields on disk: colour, scan order, video segments, the container."""
