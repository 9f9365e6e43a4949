"""Tables of the store: layouts, rate and distortion, the cost of reading."""
