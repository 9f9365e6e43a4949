"""Options that several commands have, each declared once."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import lfcore
from lfcore.cli import values
from lfcore.scene.emitters import POINTS
from lfcore.storage.codecs import CODECS
from lfcore.storage.pixels import PIXEL_FORMATS

Options = argparse._ActionsContainer
"""A parser, or a group of its options."""


def add_lightfield(command: Options) -> None:
    """The light field file that a command reads, for :func:`lfcore.cli.command.open_field`."""
    command.add_argument("lightfield", help="light field file (.mkv), or its URL")
    command.add_argument(
        "--salvage", action="store_true", help="leave out damaged segments instead of refusing"
    )


def add_output(command: Options, help: str) -> None:
    command.add_argument("-o", "--output", type=Path, required=True, help=help)


def add_device(command: Options) -> None:
    command.add_argument(
        "--device", metavar="NAME", help="part of an OpenCL device's name; see 'lfcore devices'"
    )


def add_scene(
    command: Options,
    name: str = "scene",
    help: str = "scene.yaml, its folder, a mesh or a .pbrt file",
) -> None:
    """The scene that a command traces, and the device that traces it."""
    command.add_argument(name, type=Path, help=help)
    command.add_argument(
        "--light-points", type=values.count(), default=POINTS, metavar="P",
        help=f"points per area light of a pbrt scene ({POINTS})",
    )  # fmt: skip
    command.add_argument(
        "--up", choices=("y", "z"), default="y", help="axis of a mesh that points up (y)"
    )
    add_device(command)


def add_views(command: Options, help: str) -> None:
    command.add_argument("--views", type=values.views, metavar="N", help=help)


def add_pixels(command: Options, help: str = "M x M pixels (256)") -> None:
    # The default is None: a scene with a film of its own has its own number of pixels.
    command.add_argument("--pixels", type=values.pixels, metavar="M", help=help)


def add_lens(group: Options) -> None:
    """Focus and f-number of the lens that traces."""
    group.add_argument(
        "--focus", type=values.distance, metavar="M", help="focus distance: metres, or 'inf'"
    )
    group.add_argument("--f-number", type=values.positive, metavar="F", help="f-number")


def add_quality(group: Options, help: str) -> None:
    """A quality instead of a number of rays."""
    group.add_argument("--quality-db", type=values.positive, metavar="DB", help=help)
    group.add_argument(
        "--most-rays", type=values.positive, metavar="R",
        help="rays per pixel that --quality-db may use (4096)",
    )  # fmt: skip


def add_bits(group: Options) -> None:
    group.add_argument(
        "--bits", type=int, choices=(8, 16), default=8, help="bits per sample of a PNG (8)"
    )


def add_encoder(command: argparse.ArgumentParser) -> Options:
    """Options of the video in which a light field is stored; returns their group."""
    how = command.add_argument_group("storage")
    how.add_argument("--codec", choices=tuple(CODECS), help="default: libx264; ffv1 is lossless")
    how.add_argument(
        "--crf", type=values.number(0, 63), help="constant rate factor; lower is better and larger"
    )
    how.add_argument("--preset", help="the encoder's preset")
    how.add_argument("--pixel-format", choices=tuple(PIXEL_FORMATS), help="default: by the codec")
    return how


def add_white(group: Options) -> None:
    group.add_argument(
        "--white", type=values.positive, metavar="L",
        help="camera arrays: radiance of the brightest code (default: the brightest, at least 1)",
    )  # fmt: skip


def encoder(arguments: argparse.Namespace) -> lfcore.Encoding:
    """The encoding of the options of :func:`add_encoder`."""
    names = ("codec", "pixel_format", "crf", "preset", "layout")
    return lfcore.Encoding(**given(arguments, *names))


def given(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """The arguments of these names that were given or have a default."""
    found = {name: getattr(arguments, name, None) for name in names}
    return {name: value for name, value in found.items() if value is not None}
