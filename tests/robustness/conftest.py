"""Fuzzing and accidents: processes, limits and signals of POSIX."""

import os

collect_ignore_glob = ["test_*.py"] if os.name == "nt" else []
