"""Tables of the store: layouts, rate and distortion, what it costs to read."""
