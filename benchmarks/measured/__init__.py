"""What the programs share: options, rows, sampled rays, and the worker of against.py."""
