"""Pictures against the average over their pixels and the lens."""
