"""Digests of source code: a rule whose sources changed must run again.

Snakemake watches a rule's script but not what the script imports.  :func:`source_digest` follows
the imports of a script through this repository, so that a rule's ``params`` change with them and
with nothing else.
"""

from __future__ import annotations

import ast
import functools
import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGES = ("lfcore", "workflow")
DATA = {".cl", ".h", ".yaml", ".css", ".csv"}


def source_digest(script: str | Path, root: str | Path, *more: str | Path) -> str:
    """Hex digest of a script's imports: modules below ``root``, transitively, and their data.

    A module brings the data files beside it that it names, and the kernels of each folder that it
    names as in ``"tracing/kernels"``.  A kernel counts as changed when it was touched, too, so
    that a run can be forced from there.
    The script itself is Snakemake's to watch.  ``more`` are modules that are imported by a name
    known only at run time.
    """
    root = Path(root).resolve()
    seen: set[Path] = set()
    waiting = [*_imports(Path(script).resolve(), root), *(Path(module) for module in more)]
    while waiting:
        module = waiting.pop()
        if module not in seen:
            seen.add(module)
            waiting += _imports(module, root)
    files = seen | {data for module in seen for data in _data_of(module, root)}
    digest = hashlib.sha256()
    for file in sorted(files):
        digest.update(f"{file.relative_to(root).as_posix()}\0".encode())
        digest.update(_digest_of(file))
        if file.suffix == ".cl":
            digest.update(str(file.stat().st_mtime_ns).encode())
    return digest.hexdigest()[:16]


# Rules share most of their files: what is asked of a file is asked once a run.
@functools.cache
def _digest_of(file: Path) -> bytes:
    return hashlib.sha256(file.read_bytes()).digest()


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """All statements below a module or statement; most nodes are expressions, passed over."""
    parts = ("body", "orelse", "finalbody", "handlers", "cases")
    if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
        parts = ("orelse",)  # for type checkers alone; nothing of it is run
    for part in parts:
        for child in getattr(node, part, ()):
            yield child
            yield from _statements(child)


@functools.cache
def _imports(file: Path, root: Path) -> tuple[Path, ...]:
    """Files of this repository that ``file`` imports anywhere, also inside functions."""
    found: list[Path] = []
    for node in _statements(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.ImportFrom) and node.level:
            base = file.parents[node.level - 1].relative_to(root).parts
            head = ".".join([*base, *([node.module] if node.module else [])])
            names = [head, *(f"{head}.{alias.name}" for alias in node.names)]
        else:
            continue
        for name in names:
            found += _files_of(name, root)
    return tuple(dict.fromkeys(found))


@functools.cache
def _files_of(name: str, root: Path) -> tuple[Path, ...]:
    parts = name.split(".")
    if parts[0] not in PACKAGES:
        return ()
    # Importing a module runs the packages above it.
    above = [root.joinpath(*parts[:depth], "__init__.py") for depth in range(1, len(parts) + 1)]
    module = root.joinpath(*parts).with_suffix(".py")
    return tuple(file for file in (*above, module) if file.is_file())


@functools.cache
def _data_of(module: Path, root: Path) -> tuple[Path, ...]:
    text = module.read_text(encoding="utf-8")
    beside = (file for file in module.parent.iterdir() if file.suffix in DATA and file.is_file())
    top = root / module.relative_to(root).parts[0]
    folders = {top / named for named in re.findall(r'"((?:\w+/)+kernels)[/"]', text)}
    kernels = (file for folder in folders for file in folder.iterdir() if file.suffix in DATA)
    return (*(file for file in beside if file.name in text), *kernels)
