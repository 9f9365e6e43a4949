"""Speed, size and error against peers, and the published results: see README.md."""
