"""Versions of the library's code: a rule whose code has changed must run again.

Snakemake watches a rule's script, but not the library.  So each rule has in its ``params`` the
digest of all modules that its script imports, directly or indirectly.
"""

import ast
import functools
import hashlib
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path

import lfcore

LIBRARY = Path(lfcore.__file__).parent
NAMES = re.compile(r"[\w.-]+\.(?:css|csv|html|json|js|yaml|cl|h)\b|kernels")
"""The names of files in its folder that a module may read, and of folders of kernels."""


@functools.cache
def version(script: Path) -> str:
    """Return the hex digest of the modules that a script imports, and of files that they read.

    A module of the library counts itself.
    """
    total = hashlib.sha256()
    for file in sorted(file for file in _imported(script) if LIBRARY in file.parents):
        total.update(f"{file.relative_to(LIBRARY).as_posix()}\0".encode())
        total.update(hashlib.sha256(file.read_bytes()).digest())
    return total.hexdigest()[:16]


def _imported(script: Path) -> set[Path]:
    """Return the script, and the library's files that it imports or reads, also indirectly."""
    waiting, files = [script], set()
    while waiting:
        file = waiting.pop()
        if file not in files:
            files.add(file)
            waiting += _named(file) if file.suffix == ".py" else ()
    return files


def _named(file: Path) -> Iterator[Path]:
    """Yield the library's modules that a module imports, and the files that it names."""
    text = file.read_text(encoding="utf-8")
    for node in ast.walk(ast.parse(text)):
        names: list[str] = []
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "lfcore":
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            if not isinstance(node.args[0], ast.Constant):  # any module of its package
                yield from file.parent.glob("*.py")
        yield from filter(None, map(_module, names))
    for name in set(NAMES.findall(text)) if LIBRARY in file.parents else ():
        path = file.parent / name
        yield from [f for f in path.rglob("*") if f.is_file()] if path.is_dir() else ()
        yield from [path] if path.is_file() else ()


def _module(name: str) -> Path | None:
    """Return the file of a library's module, or of the module that defines a name."""
    first, *parts = name.split(".")
    if first != "lfcore":
        return None
    if len(parts) == 1 and parts[0] in _exported():
        parts = _exported()[parts[0]].split(".")
    for length in range(len(parts), max(len(parts) - 2, 0), -1):
        path = LIBRARY.joinpath(*parts[:length])
        for file in (path.with_suffix(".py"), path / "__init__.py"):
            if file.is_file():
                return file
    return None


@functools.cache
def _exported() -> dict[str, str]:
    """Return the module of each public name."""
    tree = ast.parse((LIBRARY / "__init__.pyi").read_text(encoding="utf-8"))
    return {
        alias.name: node.module
        for node in tree.body if isinstance(node, ast.ImportFrom) and node.module
        for alias in node.names
    }  # fmt: skip


def commit() -> str:
    """Return the commit of the library's checkout; empty if it is installed elsewhere."""
    if not (LIBRARY.parent / ".git").exists():
        return ""
    command = ["git", "-C", str(LIBRARY.parent), "rev-parse", "HEAD"]
    try:
        return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()
    except OSError:
        return ""
