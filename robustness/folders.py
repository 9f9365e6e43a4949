"""Folders and surroundings that a command expects and does not find."""

import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robustness.outcome import LONGEST_MESSAGE, ROOT

SIZE = ("--pixels", "16", "--views", "2")


@dataclass(frozen=True)
class Surrounding:
    """``works``: the picture must be the undisturbed one; else one line, and a status of 1.

    ``environment`` replaces variables (None: removes); ``redirect`` is of the shell.
    """

    name: str
    works: bool = True
    environment: dict = field(default_factory=dict)
    output: str = "p.ppm"
    redirect: str = ""


def surroundings(folder: Path) -> list[Surrounding]:
    """``folder`` is one that can be written."""
    plain, empty = folder / "plain-file", folder / "empty-cache"
    plain.write_text("")
    empty.mkdir(exist_ok=True)
    return [
        Surrounding("home is /dev/null", environment={"HOME": "/dev/null"}),
        Surrounding("home does not exist", environment={"HOME": "/nowhere/at/all"}),
        Surrounding("home cannot be written", environment={"HOME": "/proc"}),
        Surrounding("no home is named", environment={"HOME": None}),
        Surrounding("cache is empty", environment={"XDG_CACHE_HOME": str(empty)}),
        Surrounding("cache is a file", environment={"XDG_CACHE_HOME": str(plain)}),
        Surrounding("cache cannot be written", environment={"XDG_CACHE_HOME": "/proc/sys"}),
        Surrounding(
            "no home, no cache, no temporary folder",
            environment={"HOME": "/dev/null", "XDG_CACHE_HOME": "/proc", "TMPDIR": "/nowhere"},
        ),
        Surrounding("ASCII terminal", environment={"LC_ALL": "C", "PYTHONIOENCODING": "ascii"}),
        Surrounding("standard input is closed", redirect="<&-"),
        Surrounding("standard output is closed", redirect=">&-"),
        Surrounding("standard error is closed", redirect="2>&-"),
        Surrounding("standard output is full", redirect=">/dev/full"),
        Surrounding("the output's folder is new", output="new/folder/p.ppm"),
        Surrounding("the output is a folder", works=False, output="."),
        Surrounding("the output is below a file", works=False, output="plain-file/p.ppm"),
        Surrounding("the output cannot be written", works=False, output="/proc/p.ppm"),
        Surrounding("threads: abc", works=False, environment={"LFCORE_THREADS": "abc"}),
        Surrounding("threads: -1", works=False, environment={"LFCORE_THREADS": "-1"}),
        Surrounding("an unknown device", works=False, environment={"LFCORE_DEVICE": "no such"}),
    ]


def try_all(folder: Path, only: Sequence[str] = ()) -> Iterator[tuple[str, str]]:
    """(name, what is wrong: empty when nothing is) of each surrounding, or of those of a name."""
    folder.mkdir(parents=True, exist_ok=True)
    undisturbed = _render(Surrounding("undisturbed"), folder)
    right = (folder / "p.ppm").read_bytes()
    if undisturbed.returncode:
        raise RuntimeError(f"fails undisturbed: {undisturbed.stderr}")
    for surrounding in surroundings(folder):
        if only and surrounding.name not in only:
            continue
        picture = folder / surrounding.output
        if picture.is_file():
            picture.unlink()
        done = _render(surrounding, folder)
        said = done.stderr.decode(errors="replace") + done.stdout.decode(errors="replace")
        yield surrounding.name, _judged(surrounding, done.returncode, said, picture, right)


def _judged(surrounding: Surrounding, status: int, said: str, picture: Path, right: bytes) -> str:
    if "Traceback" in said:
        return f"a traceback: {said[-800:]}"
    if surrounding.works:
        if status:
            return f"status {status}: {said[-400:]}"
        return "" if picture.read_bytes() == right else "another picture"
    if status != 1:
        return f"status {status}: {said[-400:]}"
    line = said.strip().rpartition("\n")[2]
    return "" if 0 < len(line) <= LONGEST_MESSAGE else f"no message: {said[-400:]}"


def _render(surrounding: Surrounding, folder: Path) -> subprocess.CompletedProcess:
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | surrounding.environment
    command = [sys.executable, "-m", "lfcore.cli", "render", str(ROOT / "scenes/sphere")]
    command += ["-o", surrounding.output, *SIZE]
    if surrounding.redirect:
        command = ["sh", "-c", f'exec "$@" {surrounding.redirect}', "sh", *command]
    return subprocess.run(
        command,
        cwd=folder,
        env={name: value for name, value in environment.items() if value is not None},
        capture_output=True,
        timeout=600,
    )
