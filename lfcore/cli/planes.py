"""Sensor planes from options: ``--focus`` and its kin, ``--plane``s, or a file of planes."""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Callable, Mapping
from pathlib import Path

import yaml

from lfcore.errors import LfcoreError, OpticsError
from lfcore.optics.camera import Camera
from lfcore.optics.planes import NORMALISATIONS, SHAPES, SensorPlane

MOST_PLANES = 100
KEYS = {
    "focus": "focus_distance_m",
    "focus_m": "focus_distance_m",
    "focus_distance_m": "focus_distance_m",
    "f": "f_number",
    "f_number": "f_number",
    "aperture": "shape",
    "shape": "shape",
    "blades": "blades",
    "rotation": "rotation_deg",
    "rotation_deg": "rotation_deg",
    "normalise": "normalise",
    "keep_magnification": "keep_magnification",
}
BY_VIEWS = {"disparity": "focus_distance_m", "aperture_views": "f_number"}
"""Keys in pixels and views, which a light field turns into metres and f-numbers of its slab."""


def add_options(command: argparse.ArgumentParser) -> None:
    """Options that say which pictures are wanted."""
    one = command.add_argument_group("the picture")
    one.add_argument(
        "--focus", type=distance, metavar="M",
        help="focus distance in metres, or 'inf' (default: as recorded)",
    )  # fmt: skip
    one.add_argument("--f-number", type=float, metavar="F", help="default: the whole lens")
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


def add_aperture(group) -> None:
    """Options on the aperture and on what its pictures are scaled by, to a group of options."""
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


def distance(text: str) -> float:
    """Metres; ``inf`` and ``infinity`` are understood."""
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"not a distance in metres: {text!r}") from None


def add_bits(group) -> None:
    group.add_argument("--bits", type=int, choices=(8, 16), default=8, help="a sample of a PNG (8)")


def add_by_views(group) -> None:
    """Options of a light field file that need no geometry, to a group of options."""
    group.add_argument(
        "--disparity", type=float, metavar="PX",
        help="instead of --focus: pixels from view to view of what is in focus, 0 as recorded",
    )  # fmt: skip
    group.add_argument(
        "--aperture-views", type=float, metavar="N", help="instead of --f-number: views across"
    )


def settle(arguments: argparse.Namespace, field) -> None:
    """Put ``--disparity`` and ``--aperture-views`` into ``focus`` and ``f_number``.

    Raises :class:`OpticsError` where both ways are used, and where metres are asked of a file that
    holds no geometry.
    """
    for option, other, convert in (
        ("disparity", "focus", field.distance_of),
        ("aperture_views", "f_number", field.f_number_of),
    ):
        given, metres = getattr(arguments, option, None), getattr(arguments, other, None)
        flag = f"--{option.replace('_', '-')}"
        if metres is not None:
            field.require_metric(f"--{other.replace('_', '-')}")
        if given is not None:
            if metres is not None:
                raise OpticsError(
                    f"excludes --{other.replace('_', '-')}", key=flag, remedy="Leave one out"
                )
            setattr(arguments, other, convert(given))
    if arguments.keep_magnification:
        field.require_metric("--keep-magnification")


def read_planes(arguments: argparse.Namespace, camera: Camera, field=None) -> list[SensorPlane]:
    """The planes that the options ask for; of a light field file, by disparity, too.

    Raises :class:`LfcoreError`, naming the option or the file's row, for what makes no plane.
    """
    default = {
        "focus_distance_m": camera.focus_distance_m if arguments.focus is None else arguments.focus,
        "f_number": camera.f_number if arguments.f_number is None else arguments.f_number,
        "shape": arguments.aperture,
        "blades": arguments.blades,
        "rotation_deg": arguments.rotation,
        "normalise": "aperture" if arguments.normalise else "lens",
        "keep_magnification": arguments.keep_magnification,
    }
    asked = [(_words(text), "--plane", None) for text in arguments.plane]
    if arguments.planes:
        rows = _rows(arguments.planes)
        asked += [(row, f"plane {k + 1}", arguments.planes) for k, row in enumerate(rows)]
    if not asked:
        asked = [({}, "plane", None)]
    if len(asked) > MOST_PLANES:
        raise OpticsError(
            f"{len(asked)} planes were asked for", remedy=f"Ask for {MOST_PLANES} at a time"
        )
    return [_plane(default, *given, field) for given in asked]


def _words(text: str) -> dict[str, str]:
    found = {}
    for part in text.split(","):
        key, equals, value = part.partition("=")
        found[key.strip()] = value.strip() if equals else "true"
    return found


def _rows(path: Path) -> list[Mapping]:
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
            "holds no list of planes",
            file=path,
            key="--planes",
            remedy="Write one '- {focus: 3.2, f: 2.8}' a line",
        )
    return rows


def _plane(
    default: Mapping, given: Mapping, key: str, file: Path | None, field=None
) -> SensorPlane:
    values = dict(default)
    for word, value in given.items():
        plain = str(word).replace("-", "_")
        name = KEYS.get(plain)
        if field is not None and plain in BY_VIEWS:
            values[BY_VIEWS[plain]] = _by_views(plain, value, key, file, field)
            continue
        if field is not None and name in ("focus_distance_m", "f_number", "keep_magnification"):
            field.require_metric(f"{key}: {word}")
        if name is None:
            known = ", ".join(dict.fromkeys(KEYS))
            raise OpticsError(f"unknown key {word!r}", file=file, key=key, remedy=f"Known: {known}")
        try:
            values[name] = _READ[name](value)
        except (ValueError, TypeError):
            raise OpticsError(f"{word} cannot be {value!r}", file=file, key=key) from None
    try:
        return SensorPlane(**values)
    except OpticsError as error:
        raise OpticsError(error.problem, file=file, key=key, remedy=error.remedy) from None


def _by_views(word: str, value: object, key: str, file: Path | None, field) -> float:
    try:
        number = _number(value)
    except (ValueError, TypeError):
        raise OpticsError(f"{word} cannot be {value!r}", file=file, key=key) from None
    return field.distance_of(number) if word == "disparity" else field.f_number_of(number)


def _choice(*known: str) -> Callable[[object], str]:
    def read(value: object) -> str:
        if value not in known:
            raise ValueError
        return str(value)

    return read


def _truth(value: object) -> bool:
    words = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
    text = str(value).lower()
    if text not in words:
        raise ValueError
    return words[text]


def _normalisation(value: object) -> str:
    if value in NORMALISATIONS:
        return str(value)
    return "aperture" if _truth(value) else "lens"


def _number(value: object) -> float:
    number = float(value)  # type: ignore[arg-type]
    if math.isnan(number):
        raise ValueError
    return number


_READ: dict[str, Callable] = {
    "focus_distance_m": _number,
    "f_number": _number,
    "shape": _choice(*SHAPES),
    "blades": int,
    "rotation_deg": _number,
    "normalise": _normalisation,
    "keep_magnification": _truth,
}


def check_planes(planes: list[SensorPlane], slab, file: Path | None) -> None:
    """Raise :class:`OpticsError`, with the file's name, for a plane that ``slab`` does not hold."""
    for plane in planes:
        try:
            plane.check(slab)
            plane.aperture(slab)
        except OpticsError as error:
            raise OpticsError(
                error.problem, file=file, key=error.key, remedy=error.remedy
            ) from None


def output_names(path: Path, planes: list[SensorPlane], field=None) -> list[Path]:
    """One name a plane: ``path`` itself for a single one, else numbered and labelled.

    Planes of a light field without a geometry are named by their disparity.
    """
    from lfcore.optics.plane_pictures import plane_label

    if len(planes) == 1:
        return [path]
    if field is None or field.metric:
        labels = [plane_label(k, plane) for k, plane in enumerate(planes)]
    else:
        moved = [field.disparity_of(plane.focus_distance_m) for plane in planes]
        labels = [
            f"{k:02d}_disparity{px:.3g}_{plane.shape}"
            for k, (px, plane) in enumerate(zip(moved, planes, strict=True))
        ]
    return [path.with_name(f"{path.stem}_{label}{path.suffix}") for label in labels]
