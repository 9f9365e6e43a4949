"""Pages of the manual whose commands are run: by the site at full size, by tests at a small size.

A page is Markdown.  Its fenced blocks of ``bash`` and ``python`` are run in order, in one folder
with links to the project's scenes and workflow; Python blocks share their names.  Comments control
the rest:

    <!-- small: --pixels 256 = --pixels 24 | views=9 = views=3 -->   replacements in tests
    <!-- picture: near.png | caption -->   shows a picture that a block made
    <!-- viewer: bike.html | caption -->   shows a page that a block made, in a frame
    <!-- given: model.glb studio.exr -->   files of the reader's, for which small ones are made
"""

from __future__ import annotations

import contextlib
import io
import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = {
    "first-picture": "tutorials/first-picture.md",
    "blender-scene": "tutorials/blender-scene.md",
    "hci-ground-truth": "tutorials/hci-ground-truth.md",
    "stanford": "tutorials/stanford.md",
    "datasets": "tutorials/datasets.md",
    "cluster": "tutorials/cluster.md",
    "gallery": "gallery.md",
}
PAGES |= {
    path.stem: f"how-to/{path.name}" for path in sorted((ROOT / "docs" / "how-to").glob("*.md"))
}
"""The pages that are run, as paths below docs/."""
LANGUAGES = ("bash", "python")
REACHED = ("Snakefile", "config", "profiles", "scenes", "workflow")
FENCE = re.compile(r"^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SMALL = re.compile(r"^<!-- small: (.*?) -->$", re.MULTILINE)
PICTURE = re.compile(r"^<!-- picture: (\S+) \| (.*?) -->$", re.MULTILINE)
VIEWER = re.compile(r"^<!-- viewer: (\S+) \| (.*?) -->$", re.MULTILINE)
GIVEN = re.compile(r"^<!-- given: (.*?) -->$", re.MULTILINE)
BEYOND_WORDS = re.compile(r"[|<>;&$*`'\"]")
"""Characters that need a shell; other ``lfcore`` commands run in this process, which is faster."""


class PageError(Exception):
    """A block of a page failed; the message has its first line and its output."""


@dataclass(frozen=True)
class Block:
    """A block to run; ``end`` is its end in the page's text."""

    language: str
    code: str
    end: int


@dataclass(frozen=True)
class Page:
    """A page and its blocks; ``small`` maps texts to their replacements in tests."""

    name: str
    text: str
    blocks: list[Block]
    small: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def read(cls, name: str) -> Page:
        """The page of this name."""
        text = (ROOT / "docs" / PAGES[name]).read_text(encoding="utf-8")
        found = (match for match in FENCE.finditer(text) if match[1] in LANGUAGES)
        blocks = [Block(match[1], match[2], match.end()) for match in found]
        pairs = (part.split(" = ") for said in SMALL.findall(text) for part in said.split(" | "))
        return cls(name, text, blocks, dict(pairs))


def run(page: Page, folder: Path, *, small: bool = False) -> list[str]:
    """Run the page's blocks in ``folder``; returns the output of each.

    Raises :class:`PageError` for a block that fails.
    """
    for name in REACHED:
        (folder / name).symlink_to(ROOT / name)
    for said in GIVEN.findall(page.text):
        for name in said.split():
            _give(folder / name)
    names: dict[str, object] = {"__name__": page.name}
    printed = []
    with contextlib.chdir(folder):
        for block in page.blocks:
            code = block.code
            for whole, tiny in page.small.items() if small else ():
                code = code.replace(whole, tiny)
            try:
                printed.append(_run(block.language, code, names))
            except Exception as error:
                first_line = block.code.strip().partition("\n")[0]
                raise PageError(f"{page.name}: {first_line}\n{error}") from error
    return printed


def _give(path: Path) -> None:
    """Make a small file in place of the reader's: a mesh, or a panorama."""
    if path.suffix == ".exr":
        import numpy as np

        from lfcore import write_picture

        write_picture(path, np.linspace(1.0, 0.1, 16 * 32 * 3, dtype="f4").reshape(16, 32, 3))
    else:
        import trimesh

        shape = trimesh.creation.box if path.suffix == ".obj" else trimesh.creation.icosphere
        shape().export(path)


def _run(language: str, code: str, names: dict[str, object]) -> str:
    if language == "python":
        return _captured(lambda: exec(compile(code, "<page>", "exec"), names))
    commands = code.replace("\\\n", " ").strip().splitlines()
    if all(line.startswith("lfcore ") and not BEYOND_WORDS.search(line) for line in commands):
        return "".join(_captured(partial(_lfcore, line)) for line in commands)
    # The environment's own commands first, as after `source .venv/bin/activate`.
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    done = subprocess.run(
        ["bash", "-euo", "pipefail", "-c", code], env=os.environ | {"PATH": path},
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, check=False,
    )  # fmt: skip
    if done.returncode:
        raise PageError(f"status {done.returncode}: {done.stdout}")
    return done.stdout


def _lfcore(line: str) -> None:
    from lfcore.cli import main

    if status := main(shlex.split(line, comments=True)[1:]):
        raise PageError(f"status {status}")


def _captured(call: Callable[[], object]) -> str:
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
        try:
            call()
        except Exception as error:
            raise PageError(f"{error}\n{printed.getvalue()}") from error
    return printed.getvalue()
