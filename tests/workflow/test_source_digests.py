"""Digests: every file that a script imports is in its rule's, and nothing but content is."""

from __future__ import annotations

import ast
import functools
import os
import re
from pathlib import Path

import pytest

import lfcore
from lfcore.workflow import sources

ROOT = Path(__file__).resolve().parents[2]
LIBRARY = Path(lfcore.__file__).parent
RULES = ROOT / "workflow" / "rules"


def named_parts() -> dict[str, set[Path]]:
    """Of each script the files whose content is in its rule's digest."""
    found = {}
    for file in sorted(RULES.glob("*.smk")):
        text = file.read_text()
        names = {"sources": sources, "digest": lambda *names: names}
        for name, value in re.findall(r"^([A-Z_]+) = (digest\((?:[^()]|\n)*\))", text, re.M | re.S):
            names[name] = eval(value, names)
        for block in re.split(r"\n\s*(?:use )?rule\b", text):
            script = re.search(r'"\.\./scripts/(\w+\.py)"', block)
            value = re.search(r"sources=((?:digest\((?:[^()]|\n)*\))|[A-Z_]+|scene_sources)", block)
            if script and value:
                parsing = (*sources.PARSING, "scene/procedural")
                chosen = parsing if value[1] == "scene_sources" else eval(value[1], names)
                files = {f for name in (*sources.BASE, *chosen) for f in sources.files(name)}
                found.setdefault(script[1], set()).update(files)
    return found


@functools.cache
def imports(file: Path) -> set[Path]:
    """Files of the library that a file imports anywhere, with the packages above them."""
    found = set()
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in list(ast.walk(tree)):
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            node.body = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            modules = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            modules = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        else:
            continue
        for module in modules:
            parts = module.split(".")
            if parts[0] == "lfcore":
                above = [
                    LIBRARY.joinpath(*parts[1:k], "__init__.py") for k in range(1, len(parts) + 1)
                ]
                found |= {*above, LIBRARY.joinpath(*parts[1:]).with_suffix(".py")}
    return {path for path in found if path.is_file()}


def closure(file: Path) -> set[Path]:
    seen, waiting = set(), [file]
    while waiting:
        for path in imports(waiting.pop()) - seen:
            seen.add(path)
            waiting.append(path)
    return seen


PARTS = named_parts()


@pytest.mark.parametrize(
    "script", sorted(path.name for path in (ROOT / "workflow/scripts").glob("*.py"))
)
def test_a_rule_s_digest_covers_what_its_script_imports(script):
    """Else Snakemake would not run the rule again after an edit."""
    missing = closure(ROOT / "workflow" / "scripts" / script) - PARTS[script]
    assert sorted(str(path.relative_to(LIBRARY)) for path in missing) == []


@pytest.mark.parametrize(
    ("part", "scripts"),
    [
        ("tracing/kernels", {"trace.py", "trace_stacks.py", "retrieve.py"}),
        ("evaluation/page.css", {"page.py"}),
        ("evaluation/metrics.py", {"evaluate.py"}),
        ("evaluation/thesis_tables.csv", {"tables.py"}),
    ],
)
def test_an_edit_runs_again_who_uses_it_and_not_those_before(part, scripts):
    users = {script for script, files in PARTS.items() if files & set(sources.files(part))}
    assert scripts <= users
    before = {"parse.py", "build.py"}
    assert not before & users
    if part != "tracing/kernels":
        assert not {"trace.py", "join.py", "retrieve.py"} & users


@pytest.mark.parametrize("part", ["run", "progress", "forecast", "costs", "cluster", "scaling"])
def test_an_edit_of_what_watches_a_run_makes_nothing_again(part):
    """Hours of tracing do not hang on how progress is shown."""
    (file,) = sources.files(f"workflow/{part}.py")
    assert not [script for script, files in PARTS.items() if file in files]


def test_a_digest_is_of_content_alone(monkeypatch, tmp_path):
    part = tmp_path / "part"
    part.mkdir()
    (part / "a.py").write_text("1")
    (part / "notes.txt").write_text("not a source")
    monkeypatch.setattr(sources, "LIBRARY", tmp_path)
    monkeypatch.setattr(sources, "BASE", ())

    def digest():
        for cached in (sources.digest, sources.files, sources._content):
            cached.cache_clear()
        return sources.digest("part")

    try:
        first = digest()
        os.utime(part / "a.py", (1, 1))
        (part / "notes.txt").write_text("still not")
        assert digest() == first
        (part / "a.py").write_text("2")
        assert digest() != first
        with pytest.raises(FileNotFoundError, match="absent names no sources"):
            sources.digest("absent")
    finally:
        for cached in (sources.digest, sources.files, sources._content):
            cached.cache_clear()


def test_scripts_are_short():
    """They adapt; what is computed stands in the library."""
    lengths = {
        path.name: len(path.read_text(encoding="utf-8").splitlines())
        for path in (ROOT / "workflow" / "scripts").glob("*.py")
    }
    assert {name: length for name, length in lengths.items() if length > 40} == {}
