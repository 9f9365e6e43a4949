"""Error against run time: what accuracy costs, by lens sampling, by method, by arithmetic."""
