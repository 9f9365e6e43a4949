"""Digests of the library's files: a rule whose sources changed must run again.

Snakemake watches a rule's script, and not what the script imports.  A rule names the parts of the
library that it uses, and carries a digest of their content in its ``params``: of nothing but
content, so that equal checkouts agree.  A test holds the names to what the scripts import.
"""

from __future__ import annotations

import functools
import hashlib
from pathlib import Path

import lfcore

LIBRARY = Path(lfcore.__file__).parent
SUFFIXES = {".py", ".cl", ".h", ".yaml", ".css", ".csv", ".js", ".html"}
BASE = ("*.py", "workflow/job.py", "scene/reading.py", "*/__init__.py", "*/*/__init__.py")
"""What every job uses."""
SCENE = ("scene/*.py", "scene/*.yaml", "optics")
"""Scenes as arrays, once they are parsed."""
PARSING = (*SCENE, "scene/pbrt", "scene/procedural/__init__.py")
TREE = (*SCENE, "tracing/__init__.py", "tracing/bvh*.py")
TRACING = (
    *SCENE,
    "opencl",
    "tracing",
    "storage/__init__.py",
    "storage/layout.py",
    "workflow/cases.py",
    "workflow/tracers.py",
)
STORING = (*TRACING, "storage", "rendering")
READING = (*STORING, "refocus")
MEASURING = (
    "evaluation/metrics.py",
    "evaluation/tables.py",
    "evaluation/table_files.py",
)
TABLES = ("evaluation/*.py", "evaluation/*.csv")


@functools.cache
def files(name: str) -> tuple[Path, ...]:
    """Source files of a folder, a file or a pattern below the library.

    Raises ``FileNotFoundError`` for a name that means nothing.
    """
    found = [LIBRARY / name] if (LIBRARY / name).is_dir() else sorted(LIBRARY.glob(name))
    found = [file for one in found for file in (one.rglob("*") if one.is_dir() else (one,))]
    found = sorted(file for file in found if file.suffix in SUFFIXES and file.is_file())
    if not found:
        raise FileNotFoundError(f"lfcore/{name} names no sources")
    return tuple(found)


@functools.cache
def digest(*names: str) -> str:
    """Hex digest of the names and contents of all files of :data:`BASE` and of these parts."""
    parts = sorted({file for name in (*BASE, *names) for file in files(name)})
    total = hashlib.sha256()
    for file in parts:
        total.update(f"{file.relative_to(LIBRARY).as_posix()}\0".encode())
        total.update(_content(file))
    return total.hexdigest()[:16]


@functools.cache
def _content(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()
