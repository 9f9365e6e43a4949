"""What the commands of ``lfcore`` share: what was asked for, the opening of files, refusals."""

from __future__ import annotations

import argparse
import json
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

import lfcore
from lfcore.cli.progress import note, recorded, say, wrote
from lfcore.errors import OpticsError
from lfcore.pictures import write_pictures


@dataclass(frozen=True)
class Command:
    """One command: what ``--help`` says of it, the options that it adds, and what it does.

    One that is for ``programs``, too, has ``--json``.
    """

    description: str
    examples: str
    options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], None]
    programs: bool = False

    def add_to(
        self, commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str, help: str
    ) -> None:
        """Add it to the commands of a parser; its texts keep their lines."""
        parser = commands.add_parser(
            name, help=help, description=self.description, epilog=self.examples,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        parser.set_defaults(run=self._record if self.programs else self.run)
        self.options(parser)
        if self.programs:
            parser.add_argument(
                "--json", action="store_true",
                help="one JSON object on standard output, for programs; no other words",
            )  # fmt: skip

    def _record(self, arguments: argparse.Namespace) -> None:
        """Run; with ``--json``, print what was done as one line of JSON when all of it is."""
        if not arguments.json:
            self.run(arguments)
            return
        with recorded(arguments.command) as record:
            self.run(arguments)
        print(json.dumps(_finite(record), allow_nan=False))


def _finite(value: Any) -> Any:
    """The same without numbers that JSON has not: "inf" is what options take, too."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


def encoder(arguments: argparse.Namespace) -> lfcore.Encoding:
    """The encoding that the options describe."""
    names = ("codec", "pixel_format", "crf", "preset", "layout", "depth")
    return lfcore.Encoding(**given(arguments, *names))


def open_field(arguments: argparse.Namespace) -> lfcore.LightField:
    """The light field of the command line; damage that is left out is told."""
    field = lfcore.LightField.open(arguments.lightfield, salvage=arguments.salvage)
    for damage in field.damage:
        say(f"left out: {damage.reason}")
    return field


def open_scene(arguments: argparse.Namespace) -> lfcore.Scene:
    """The scene of the command line; tells its size, and what was not read exactly or left out."""
    scene = lfcore.load_scene(arguments.scene, light_points=arguments.light_points, up=arguments.up)
    if scene.notes:
        say(scene.summary())
    say(f"{scene.name}: {scene.triangle_count} triangles")
    note(scene={"name": scene.name, "triangles": scene.triangle_count, "left_out": scene.dropped})
    for reason, count in scene.dropped.items():
        say(f"{count} triangles were left out: {reason}")
    return scene


def given(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Those of these arguments that were given, or have a default."""
    found = {name: getattr(arguments, name, None) for name in names}
    return {name: value for name, value in found.items() if value is not None}


def asked(arguments: argparse.Namespace, names: Sequence[str]) -> list[str]:
    """The options of these names that were asked for; with 0, too, if wrongly."""
    found = {option(name): getattr(arguments, name, None) for name in names}
    return [key for key, value in found.items() if value not in (None, []) and value is not False]


def option(name: str) -> str:
    """An argument's name as it is typed."""
    return f"--{name.replace('_', '-')}"


def refuse(key: str, problem: str, remedy: str | None = None) -> NoReturn:
    """Raise :class:`OpticsError` on an option, or on options that do not go together."""
    raise OpticsError(problem, key=key, remedy=remedy)


def exclude(key: str, other: str) -> NoReturn:
    """Refuse two options of which one says what the other does."""
    refuse(key, f"excludes {other}", "Leave one out")


def write_named(named: Sequence[tuple[Path, np.ndarray]], *, bits: int = 8) -> None:
    """Write pictures, all or none, and say where."""
    write_pictures(named, bits=bits)
    for path, _ in named:
        wrote(path)
