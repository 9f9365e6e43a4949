"""Versions of the library's code: a rule whose code changed must run again.

Snakemake watches a rule's script, and not the library behind it.  So each rule names its stage,
and has the digest of that stage's packages in its ``params``.
"""

import functools
import hashlib
from pathlib import Path

import lfcore

LIBRARY = Path(lfcore.__file__).parent
SUFFIXES = {".py", ".cl", ".h", ".yaml", ".css", ".csv", ".js", ".html"}
SCENE = ("optics", "scene")
TREE = (*SCENE, "tracing")
TRACE = (*TREE, "opencl", "baking", "rendering", "storage", "workflow")
PICTURE = (*TRACE, "refocus", "viewer")
STAGES = {
    "scene": (*SCENE, "readers"),
    "tree": TREE,
    "trace": TRACE,
    "store": (*SCENE, "storage", "workflow"),
    "picture": PICTURE,
    "dataset": (*PICTURE, "readers", "exchange", "datasets"),
    "report": (*PICTURE, "readers", "evaluation", "oracle"),
}
"""The packages of each stage, beside the modules of lfcore itself."""


@functools.cache
def version(stage: str) -> str:
    """Hex digest of the names and contents of a stage's files, and of nothing else."""
    found = set(LIBRARY.glob("*.py"))
    for package in STAGES[stage]:
        found |= {file for file in (LIBRARY / package).rglob("*") if file.suffix in SUFFIXES}
    total = hashlib.sha256()
    for file in sorted(found):
        total.update(f"{file.relative_to(LIBRARY).as_posix()}\0".encode())
        total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()[:16]
