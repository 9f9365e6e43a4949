"""Fuzzing and accidents: processes, limits and signals of POSIX."""

import os

collect_ignore_glob = ["test_*.py"] if os.name == "nt" else []


def pytest_collection_modifyitems(config, items):
    """Accidents take an hour: they run only with ``-m accidents``."""
    if "accidents" not in config.option.markexpr:
        left_out = [item for item in items if item.get_closest_marker("accidents")]
        config.hook.pytest_deselected(items=left_out)
        items[:] = [item for item in items if item not in left_out]
