"""Options that several commands have, each declared once."""

from __future__ import annotations

import argparse
from pathlib import Path

from lfcore.scene.emitters import POINTS
from lfcore.storage.codecs import CODECS
from lfcore.storage.pixels import PIXEL_FORMATS

Options = argparse._ActionsContainer
"""A parser, or a group of its options."""


def distance(text: str) -> float:
    """Metres; ``inf`` and ``infinity`` are understood."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"not a distance in metres: {text!r}") from None


def add_lightfield(command: Options) -> None:
    """The light field file that a command reads, for :func:`lfcore.cli.command.open_field`."""
    command.add_argument("lightfield", help="light field file, .mkv, or its URL")
    command.add_argument(
        "--salvage", action="store_true", help="leave out damaged segments instead of refusing"
    )


def add_output(command: Options, what: str) -> None:
    command.add_argument("-o", "--output", type=Path, required=True, help=what)


def add_device(command: Options) -> None:
    command.add_argument(
        "--device", metavar="NAME", help="part of an OpenCL device's name; see 'lfcore devices'"
    )


def add_scene(
    command: Options,
    name: str = "scene",
    what: str = "scene.yaml, its folder, a mesh or a .pbrt file",
) -> None:
    """The scene that a command traces, and the device that does it."""
    command.add_argument(name, type=Path, help=what)
    command.add_argument(
        "--light-points", type=int, default=POINTS, metavar="P",
        help=f"points of each area light of a pbrt scene ({POINTS})",
    )  # fmt: skip
    command.add_argument("--up", choices=("y", "z"), default="y", help="axis of a mesh (y)")
    add_device(command)


def add_lens(group: Options, focus: str, f_number: str) -> None:
    """Focus and f-number, with what is to be said of each."""
    group.add_argument("--focus", type=distance, metavar="M", help=focus)
    group.add_argument("--f-number", type=float, metavar="F", help=f_number)


def add_encoder(command: argparse.ArgumentParser, *, of_array: bool = False) -> Options:
    """Options of the video that a light field, or an array, is stored in; returns their group."""
    how = command.add_argument_group("storage")
    how.add_argument(
        "--codec", choices=tuple(CODECS), default="libx264", help="ffv1 is lossless (libx264)"
    )
    how.add_argument("--crf", type=float, help="lower is better and larger (default: by N)")
    how.add_argument("--preset", help="of the encoder (default: by N)")
    how.add_argument("--pixel-format", choices=tuple(PIXEL_FORMATS), help="default: by the codec")
    if of_array:
        how.add_argument(
            "--white", type=float, metavar="L",
            help="of an array: radiance of the brightest code (default: the brightest, at least 1)",
        )  # fmt: skip
    return how
