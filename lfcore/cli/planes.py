"""Sensor planes from options: ``--focus`` and its kin, ``--plane``s, or a file of planes."""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import lfcore
from lfcore.cli.command import exclude, option, write_named
from lfcore.cli.options import Options, add_lens
from lfcore.errors import LfcoreError, OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.planes import NORMALISATIONS, SHAPES, SensorPlane

MOST_PLANES = 100
INSTEAD = {"disparity_px": "focus_m", "aperture_views": "f_number"}
"""Settings in pixels and views, which a light field file alone can turn into the others."""
OPTIONS = {"focus_m": "focus", "disparity_px": "disparity", "rotation_deg": "rotation"}
"""Settings, as :meth:`lfcore.LightField.plane` names them, whose options have other names."""
APERTURE = ("aperture", "blades", "rotation_deg", "normalise", "keep_magnification")
"""Settings of :func:`add_aperture`."""


def add_options(command: argparse.ArgumentParser) -> None:
    """Options that say which pictures are wanted."""
    one = command.add_argument_group("the picture")
    focus = "focus distance in metres, or 'inf' (default: as recorded)"
    add_lens(one, focus, "default: the whole lens")
    add_aperture(one)
    add_bits(one)
    many = command.add_argument_group("many pictures (up to 100), from one pass")
    many.add_argument(
        "--plane", action="append", default=[], metavar="KEY=VALUE,...",
        help="e.g. 'focus=3.2,f=2.8,aperture=polygon,blades=5'; again for each picture; what is "
        "not said is as above",
    )  # fmt: skip
    many.add_argument(
        "--planes", type=Path, metavar="FILE",
        help="the same keys: a YAML list of mappings, or CSV with a header",
    )  # fmt: skip


def add_aperture(group: Options) -> None:
    """Options on the aperture, and on what its pictures are scaled by."""
    group.add_argument("--aperture", choices=SHAPES, default="circle", help="default: circle")
    group.add_argument("--blades", type=int, default=6, help="corners of a polygon (6)")
    group.add_argument(
        "--rotation", type=float, default=0.0, metavar="DEG", help="of a polygon, degrees (0)"
    )
    group.add_argument(
        "--normalise", action=argparse.BooleanOptionalAction, default=True,
        help="same brightness at every aperture; --no-normalise dims as the lens stops down",
    )  # fmt: skip
    group.add_argument(
        "--keep-magnification", action="store_true",
        help="zoom slightly with focus, as a sensor that is moved does",
    )  # fmt: skip


def add_bits(group: Options) -> None:
    group.add_argument("--bits", type=int, choices=(8, 16), default=8, help="a sample of a PNG (8)")


def add_by_views(group: Options) -> None:
    """Options of a light field file that need no geometry."""
    group.add_argument(
        "--disparity", type=float, metavar="PX",
        help="instead of --focus: pixels from view to view of what is in focus, 0 as recorded",
    )  # fmt: skip
    group.add_argument(
        "--aperture-views", type=float, metavar="N", help="instead of --f-number: views across"
    )


def settings(arguments: argparse.Namespace, names: Iterable[str]) -> dict[str, Any]:
    """What options say of every plane; keys as :meth:`lfcore.LightField.plane` takes them.

    Raises :class:`OpticsError` for a focus or aperture that is given in both ways.
    """
    found = {name: getattr(arguments, OPTIONS.get(name, name), None) for name in names}
    found = {name: value for name, value in found.items() if value is not None}
    for ours, theirs in INSTEAD.items():
        if ours in found and theirs in found:
            exclude(_flag(ours), _flag(theirs))
    return found


def read_planes(
    arguments: argparse.Namespace, source: lfcore.LightField | Camera
) -> list[SensorPlane]:
    """The planes that the options ask for, of a light field or of a camera whose scene is traced.

    Raises :class:`LfcoreError`, naming the option or the file's row, for what makes no plane.
    """
    default, file = settings(arguments, _READ), arguments.planes
    asked: list[tuple[dict[str, Any], str | None, Path | None]]
    asked = [(_words(text), "--plane", None) for text in arguments.plane]
    asked += [(row, f"plane {k}", file) for k, row in enumerate(_rows(file) if file else (), 1)]
    if len(asked) > MOST_PLANES:
        raise OpticsError(
            f"{len(asked)} planes were asked for", remedy=f"Ask for {MOST_PLANES} at a time"
        )
    return [
        make_plane(source, laid_over(default, _read(row, source, key, at)), key, at)
        for row, key, at in asked or [({}, None, None)]
    ]


def laid_over(default: Mapping[str, Any], asked: Mapping[str, Any]) -> dict[str, Any]:
    """``asked``, and what it leaves open of ``default``: a focus or aperture in either way."""
    said = {INSTEAD.get(name, name) for name in asked}
    return {k: v for k, v in default.items() if INSTEAD.get(k, k) not in said} | dict(asked)


def make_plane(
    source: lfcore.LightField | Camera,
    asked: Mapping[str, Any],
    key: str | None = None,
    file: Path | None = None,
) -> SensorPlane:
    """A plane of the settings ``asked`` for; errors name their place, where there is one."""
    make = partial(SensorPlane.of, source) if isinstance(source, Camera) else source.plane
    try:
        return make(**asked)
    except OpticsError as error:
        place = key or (_flag(error.key) if error.key and error.key in asked else error.key)
        raise error.named(OpticsError, file=file, key=place) from None


def _flag(setting: str) -> str:
    return option(OPTIONS.get(setting, setting))


def _words(text: str) -> dict[str, Any]:
    parts = (part.partition("=") for part in text.split(","))
    return {key.strip(): value.strip() if equals else "true" for key, equals, value in parts}


def _rows(path: Path) -> list[dict[str, Any]]:
    try:
        text = path.read_text(encoding="utf-8")
    except UnicodeDecodeError:
        raise LfcoreError("is no text", file=path, key="--planes") from None
    if path.suffix.lower() == ".csv":
        return [
            {key: value for key, value in row.items() if key and value}
            for row in csv.DictReader(text.splitlines())
        ]
    try:
        rows = yaml.safe_load(text)
    except yaml.YAMLError as error:
        problem = " ".join(str(error).split())
        raise LfcoreError(f"is no YAML: {problem}", file=path, key="--planes") from None
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        raise LfcoreError(
            "holds no list of planes", file=path, key="--planes",
            remedy="Write one '- {focus: 3.2, f: 2.8}' a line",
        )  # fmt: skip
    return rows


def _read(
    row: Mapping[str, Any], source: lfcore.LightField | Camera, key: str | None, file: Path | None
) -> dict[str, Any]:
    """The settings of a row's words."""
    known = _OTHER_WORDS | {name: name for name in _READ}
    if isinstance(source, Camera):
        known = {word: name for word, name in known.items() if name not in INSTEAD}
    found = {}
    for word, value in row.items():
        name = known.get(str(word).replace("-", "_"))
        if name is None:
            words = ", ".join(known)
            raise OpticsError(f"unknown key {word!r}", file=file, key=key, remedy=f"Known: {words}")
        try:
            found[name] = _READ[name](value)
        except (ValueError, TypeError, KeyError):
            raise OpticsError(f"{word} cannot be {value!r}", file=file, key=key) from None
    return found


def _truth(value: object) -> bool:
    words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
    return words[str(value).lower()]


def _number(value: object) -> float:
    number = float(str(value))
    if math.isnan(number):
        raise ValueError
    return number


_READ: dict[str, Callable[[object], object]] = {
    "focus_m": _number,
    "f_number": _number,
    "aperture": lambda value: SHAPES[SHAPES.index(value)],
    "blades": lambda value: int(str(value)),
    "rotation_deg": _number,
    "normalise": lambda value: value == "aperture" if value in NORMALISATIONS else _truth(value),
    "keep_magnification": _truth,
    "disparity_px": _number,
    "aperture_views": _number,
}
"""What reads a setting's value, of text or of YAML; errors are ValueError, TypeError, KeyError."""
_OTHER_WORDS = {
    "focus": "focus_m", "f": "f_number", "rotation": "rotation_deg", "disparity": "disparity_px",
}  # fmt: skip
"""Words for settings beside their own names."""


def save(
    path: Path, planes: list[SensorPlane], pictures: np.ndarray, bits: int,
    field: lfcore.LightField | None = None,
) -> None:  # fmt: skip
    """Write what was made and say where; several planes go to one NPY, or a file each."""
    if path.suffix.lower() == ".npy":
        write_named([(path, pictures[0] if len(planes) == 1 else pictures)])
    else:
        names = [path] if len(planes) == 1 else output_names(path, planes, field)
        write_named(list(zip(names, pictures, strict=True)), bits=bits)


def output_names(
    path: Path, planes: list[SensorPlane], field: lfcore.LightField | None
) -> list[Path]:
    """A numbered name a plane, with its settings: its disparity, of a light field without metres"""
    from lfcore.optics.plane_pictures import plane_label

    if field is None or field.metric:
        labels = [plane_label(k, plane) for k, plane in enumerate(planes)]
    else:
        moved = [field.disparity_of(plane.focus_m) for plane in planes]
        labels = [
            f"{k:02d}_disparity{px:.3g}_{plane.aperture}"
            for k, (px, plane) in enumerate(zip(moved, planes, strict=True))
        ]
    return [path.with_name(f"{path.stem}_{label}{path.suffix}") for label in labels]
