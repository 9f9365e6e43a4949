"""The base of all commands: parser, ``--json``, opening files and devices, refusing options."""

from __future__ import annotations

import argparse
import json
import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

import lfcore
from lfcore.cli.progress import note, recorded, say, wrote
from lfcore.errors import DeviceError, OpticsError, one_line
from lfcore.pictures import write_pictures


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and whose values may be ``-1.5px``."""

    def __init__(self, *args: Any, **options: Any):
        super().__init__(*args, **options)
        self.formatter_class, self.allow_abbrev = argparse.RawDescriptionHelpFormatter, False
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        found, unknown = super().parse_known_args(args, namespace)
        if unknown and " " in self.prog:  # a command, which the whole program would not name
            self.error(f"unknown: {' '.join(unknown)}")
        return found, unknown

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{one_line(f'{self.prog}: {message}')}. See '{self.prog} --help'.\n")


@dataclass(frozen=True)
class Command:
    """One command: texts for ``--help``, and functions that add its options and run it.

    One without ``run`` has commands of its own.
    """

    description: str
    examples: str
    options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], None] | None = None

    def add_to(self, commands: argparse._SubParsersAction[Any], name: str, help: str) -> None:
        """Add it to the commands of a parser."""
        parser = commands.add_parser(
            name, help=help, description=self.description, epilog=self.examples
        )
        self.options(parser)
        if self.run is not None:
            parser.set_defaults(run=partial(_run, self.run), command=name)
            parser.add_argument(
                "--json", action="store_true", help="print one JSON object for programs, no words"
            )


def _run(run: Callable[[argparse.Namespace], None], arguments: argparse.Namespace) -> None:
    """Run a command; with ``--json``, print the record as one line when all is done."""
    # First of all: a device that is not there is an error also where it has nothing to do.
    if getattr(arguments, "device", None) is not None:
        try:
            arguments.device = lfcore.open_device(arguments.device)
        except DeviceError as error:
            key = "--device" if error.key == "device" else error.key
            raise error.named(DeviceError, key=key) from None
    if not arguments.json:
        run(arguments)
        return
    with recorded(arguments.command) as record:
        run(arguments)
    print(json.dumps(_finite(record), allow_nan=False))


def _finite(value: Any) -> Any:
    """The same with "inf" for infinity, which JSON lacks."""
    if isinstance(value, dict):
        return {key: _finite(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(one) for one in value]
    return value if not isinstance(value, float) or math.isfinite(value) else str(value)


def open_field(arguments: argparse.Namespace) -> lfcore.LightField:
    """The light field of the command line; reports damaged segments that are left out."""
    field = lfcore.LightField.open(arguments.lightfield, salvage=arguments.salvage)
    for damage in field.damage:
        say(f"left out: {damage.reason}")
    return field


def open_scene(arguments: argparse.Namespace) -> lfcore.Scene:
    """The scene of the command line; reports its size and what was approximated or left out."""
    scene = lfcore.load_scene(
        arguments.scene, light_points=arguments.light_points, up=arguments.up,
        view_from=arguments.view_from, zoom=arguments.zoom, light=arguments.sky,
        bare=arguments.bare,
    )  # fmt: skip
    if scene.notes:
        say(scene.summary())
    seen = scene.depth_range
    say(f"{scene.name}: {scene.triangle_count} triangles" + (f", {seen}" if seen else ""))
    note(scene={"name": scene.name, "triangles": scene.triangle_count, "left_out": scene.dropped})
    if seen:
        note(**{f"{end}_m": distance for end, distance in seen.ends().items()})
    for reason, count in scene.dropped.items():
        say(f"{count} triangles were left out: {reason}")
    return scene


def refuse(key: str, problem: str, remedy: str | None = None) -> NoReturn:
    """Raise :class:`OpticsError` on an option, or on options that exclude each other."""
    raise OpticsError(problem, key=key, remedy=remedy)


def write_named(named: Sequence[tuple[Path, np.ndarray]], **form: Any) -> None:
    """Write pictures, all or none, and report their names; ``form`` as of ``--bits`` and
    ``--exposure``."""
    write_pictures(named, **form)
    for path, _ in named:
        wrote(path)
