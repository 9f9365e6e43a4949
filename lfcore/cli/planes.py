"""Sensor planes from options: ``--focus``, ``--f-number``, ``--aperture`` and ``--plane``."""

from __future__ import annotations

import argparse
import csv
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

import lfcore
from lfcore.cli import values
from lfcore.cli.command import Options, add, given, refuse, write_named
from lfcore.cli.progress import note, say
from lfcore.errors import LfcoreError, OpticsError
from lfcore.optics.planes import MOST_PLANES, SensorPlane
from lfcore.optics.size import Pixels
from lfcore.refocus.pulling import Key

READ = {
    "focus": values.focus,
    "focus_at": values.place,
    "f_number": values.f_number,
    "blur": values.blur,
    "aperture": values.aperture,
    "lens": lambda text: {"lens": text},
    "normalise": lambda text: {"normalise": text},
    "keep_magnification": lambda text: {"keep_magnification": values.truth(text)},
}
"""The keys of ``--plane`` and of files of planes, with functions from text to settings."""
INSTEAD = {"focus_at": "focus", "blur": "f_number"}
"""The keys that replace others."""


def add_options(command: argparse.ArgumentParser, *, of_file: bool) -> None:
    """Add the options of pictures of a light field file, or of a scene."""
    picture = command.add_argument_group("the picture")
    add_focus(picture, of_file=of_file)
    add(picture, "aperture", "lens", "normalise", "bits", "exposure", "sensor")
    picture.add_argument(
        "--dual-pixel", action="store_true",
        help="write what the left and the right half of the aperture see, too, FILE_left and "
        "FILE_right, whose mean is the picture; and, of a scene or a file with depth, "
        "FILE_disparity.exr: pixels from left to right, positive behind the focus",
    )  # fmt: skip
    many = command.add_argument_group(f"many pictures (up to {MOST_PLANES}) from one pass")
    many.add_argument(
        "--plane", action="append", default=[], metavar="KEY=VALUE,...",
        help="repeat for each picture, e.g. focus=3.2,f_number=2.8,aperture=polygon:5; or a file "
        "with such keys, a YAML list or CSV; keep_magnification=yes changes the magnification with "
        "the focus, as a moving sensor does",
    )  # fmt: skip


def add_focus(group: Options, *, of_file: bool) -> None:
    """Add the options of the focus and of the aperture's width."""
    pull = "; of a film 2:6, pulled from 2 m to 6 m"
    px, views = (f", or disparity: 1.5px{pull}", ", or width: 7views") if of_file else ("", "")
    focus, aperture = group.add_mutually_exclusive_group(), group.add_mutually_exclusive_group()
    focus.add_argument(
        "--focus", type=values.pull if of_file else values.focus, metavar="FOCUS",
        help=f"metres, inf, near, middle, far, 40%% of the visible depth{px}",
    )  # fmt: skip
    focus.add_argument(
        "--focus-at", type=values.place, metavar="X,Y", dest="focus",
        help="focus on a place of the picture: 0,0 is its upper left corner, 1,1 the lower right",
    )  # fmt: skip
    aperture.add_argument(
        "--f-number", type=values.f_number, metavar="F", help=f"f-number{views} (the whole lens)"
    )
    aperture.add_argument(
        "--blur", type=values.blur, metavar="SHARE", dest="f_number",
        help="blur at the near or far end, whichever has more, relative to the picture's shorter "
        "side: 3%%",
    )  # fmt: skip


def settings(arguments: argparse.Namespace, *names: str) -> dict[str, dict[str, Any]]:
    """The settings of the flags that were given, by flag."""
    return {
        name: value if isinstance(value, dict) else {name: value}
        for name, value in given(arguments, *(names or READ)).items()
    }


def read_planes(
    arguments: argparse.Namespace,
    source: lfcore.LightField | lfcore.Scene,
    pixels: Pixels | None = None,
) -> list[SensorPlane]:
    """The planes that the options describe, of a light field, or of a scene with ``pixels``."""
    rows: list[tuple[dict[str, Any], str | None, Path | None]] = []
    for text in arguments.plane:
        if "=" in text:
            rows.append((_words(text), "--plane", None))
        else:
            file = Path(text)
            rows += [(row, f"plane {k}", file) for k, row in enumerate(_rows(file), 1)]
    check_count(len(rows))
    default = settings(arguments)
    return [
        make_plane(source, default | _read(row, key, file), key, file, pixels)
        for row, key, file in rows or [({}, None, None)]
    ]


def formed_planes(arguments: argparse.Namespace, planes: list[SensorPlane]) -> list[SensorPlane]:
    """The planes whose pictures are formed: with ``--dual-pixel``, both halves of each."""
    if not arguments.dual_pixel:
        return planes
    if any(plane.half for plane in planes):
        refuse("--dual-pixel", "halves a whole aperture", "Leave out the half")
    check_count(2 * len(planes))
    return [half for plane in planes for half in plane.halves()]


def scene_disparities(
    arguments: argparse.Namespace, planes: list[SensorPlane], scene: lfcore.Scene, pixels: Pixels
) -> np.ndarray | None:
    """The disparity at each pixel of a scene's dual-pixel pairs, (P, H, W); None without pairs."""
    if not arguments.dual_pixel:
        return None
    from lfcore.optics.dual_pixel import disparity_map
    from lfcore.rendering.depth import depth_of_views
    from lfcore.rendering.prepared import open_dark_tracer

    slab = lfcore.Slab.of(scene.camera, 1, pixels)
    depth = depth_of_views(open_dark_tracer(scene, arguments.device), slab)[0]
    return np.stack([disparity_map(slab, plane, depth) for plane in planes])


def file_disparities(
    arguments: argparse.Namespace, planes: list[SensorPlane], field: lfcore.LightField, pixels: int
) -> np.ndarray | None:
    """As :func:`scene_disparities`, of a file whose pictures' longer side is ``pixels``; None also
    of a file without depth."""
    if not arguments.dual_pixel:
        return None
    if field.metadata.depth is None:
        say("no disparity: the file holds no depth")
        return None
    from lfcore.optics.dual_pixel import disparity_map
    from lfcore.refocus.free_views import inverse_depth

    depth, slab = field.metres(inverse_depth(field, pixels)), field.require_slab().resized(pixels)
    return np.stack([disparity_map(slab, plane, depth) for plane in planes])


def check_count(pictures: int) -> None:
    """Raise :class:`OpticsError` for more pictures than one pass makes."""
    if pictures > MOST_PLANES:
        remedy = f"Give at most {MOST_PLANES} at a time"
        raise OpticsError(f"{pictures} pictures are too many for one pass", remedy=remedy)


def make_plane(
    source: lfcore.LightField | lfcore.Scene,
    settings: Mapping[str, Mapping[str, Any]],
    key: str | None = None,
    file: Path | None = None,
    pixels: Pixels | None = None,
) -> SensorPlane:
    """Make a plane of these settings by flag, of a scene with ``pixels``.

    Errors name the file and its row, or the parameter.
    """
    merged: dict[str, Any] = {}
    for setting in settings.values():
        merged |= setting
    if pixels is not None:
        _refuse_views(merged, key)
        merged["pixels"] = pixels
    try:
        return source.plane(**merged)
    except OpticsError as error:
        raise error.named(OpticsError, file=file, key=key) from None


def _refuse_views(settings: Mapping[str, Any], key: str | None = None) -> None:
    """Raise :class:`OpticsError` for settings that only light field files have."""
    for name in settings.keys() & {"disparity_px", "aperture_views"}:
        refuse(key or name, "pixels and views belong to a light field file",
               "Give metres and an f-number")  # fmt: skip


def of_scene(arguments: argparse.Namespace) -> dict[str, Any]:
    """The focus and the aperture of the traced lens, as keywords of :func:`lfcore.record`."""
    merged = (arguments.focus or {}) | (arguments.f_number or {})
    _refuse_views(merged)
    return merged


def read_keys(arguments: argparse.Namespace, field: lfcore.LightField) -> list[Key]:
    """The keys of a film's pulled focus, of a table or of the options."""
    first, last = field.times[0], field.times[-1]
    if arguments.keys is None:
        ends = (arguments.focus or {}).get("pull", [arguments.focus or {}])
        given = settings(arguments)
        return [
            (time, make_plane(field.at(number), {**given, "focus": end}))
            for time, number, end in zip((first, last), (0, -1), ends, strict=False)
        ]
    keys: list[Key] = []
    radius = field.require_slab().camera.lens_radius_m
    for number, row in enumerate(_rows(arguments.keys), 1):
        key, where = f"key {number}", {"file": arguments.keys, "key": f"key {number}"}
        try:
            time = values.number()(str(row.pop("time", "")))
            if "view" in row:
                point = [float(part) for part in str(row.pop("view")).strip("[]()").split()]
                keys.append((time, (radius * np.array(point).reshape(2)).tolist()))
                if row:
                    raise OpticsError(f"view excludes {min(row)}", **where)
                continue
        except (ValueError, argparse.ArgumentTypeError) as error:
            remedy = "Give a time in seconds, and a view as two shares of the lens: 0.5 0"
            raise OpticsError(str(error), **where, remedy=remedy) from None
        nearest = int(np.abs(np.array(field.times) - time).argmin())
        given = settings(arguments) | _read(row, key, arguments.keys)
        keys.append((time, make_plane(field.at(nearest), given, key, arguments.keys)))
    return keys


def report(planes: list[SensorPlane]) -> None:
    """Report a picture's focus and f-number; the names of several pictures have them."""
    if len(planes) == 1:
        say(f"focus {planes[0].focus_m:.4g} m, f/{planes[0].f_number:.3g}")
    note(planes=[{"focus_m": plane.focus_m, "f_number": plane.f_number} for plane in planes])


def say_doubts(planes: list[SensorPlane], field: lfcore.LightField) -> None:
    """Report the limits of the file that pictures exceed, once each."""
    for line in dict.fromkeys(line for plane in planes for line in field.doubts(plane)):
        say(line)


def labels(planes: list[SensorPlane], field: lfcore.LightField) -> list[str]:
    """The label of each picture: focus and f-number, or disparity if distances are unknown."""
    if field.metric:
        return [f"{plane.focus_m:.3g} m, f/{plane.f_number:.3g}" for plane in planes]
    return [f"{field.disparity_of(plane.focus_m):.3g} px" for plane in planes]


def _words(text: str) -> dict[str, Any]:
    parts = (part.partition("=") for part in text.split(","))
    return {key.strip(): value.strip() if equals else "yes" for key, equals, value in parts}


def _rows(path: Path) -> list[dict[str, Any]]:
    import yaml  # loaded for files of planes alone

    try:
        text = path.read_text(encoding="utf-8")
        rows = list(csv.DictReader(text.splitlines())) if path.suffix.lower() == ".csv" else None
        rows = yaml.safe_load(text) if rows is None else rows
    except (UnicodeDecodeError, yaml.YAMLError) as error:
        problem = " ".join(str(error).split())
        raise LfcoreError(f"cannot be read: {problem}", file=path, key="--plane") from None
    if not isinstance(rows, list) or not rows or not all(isinstance(row, dict) for row in rows):
        problem = "holds no list of planes"
        remedy = "Write one '- {focus: 3.2, f_number: 2.8}' per line"
        raise LfcoreError(problem, file=path, key="--plane", remedy=remedy)
    return [{key: value for key, value in row.items() if value != ""} for row in rows]


def _read(row: Mapping[str, Any], key: str | None, file: Path | None) -> dict[str, Any]:
    """The settings of one plane, by key."""
    settings = {}
    for word, value in row.items():
        name = str(word).replace("-", "_")
        if name not in READ:
            remedy = f"Known: {', '.join(READ)}"
            raise OpticsError(f"unknown key {word!r}", file=file, key=key, remedy=remedy)
        try:
            settings[INSTEAD.get(name, name)] = READ[name](str(value))
        except argparse.ArgumentTypeError as error:
            raise OpticsError(f"{word}: {error}", file=file, key=key) from None
    return settings


def save(
    path: Path, planes: list[SensorPlane], pictures: np.ndarray, options: Mapping[str, Any],
    field: lfcore.LightField | None = None, disparities: np.ndarray | None = None,
) -> None:  # fmt: skip
    """Write pictures, in one NPY or in a file each, and report their names.

    A file's name has its number and settings.  ``options`` has keywords of :func:`write_named`.
    Twice as many pictures as planes are dual-pixel pairs: their means are written, too, and their
    ``disparities`` (P, H, W).
    """
    names = [path]
    if len(planes) > 1:
        from lfcore.optics.plane_pictures import plane_label

        labels = [plane_label(k, plane) for k, plane in enumerate(planes)]
        if field is not None and not field.metric:
            labels = [
                f"{k:02d}_disparity{field.disparity_of(plane.focus_m):.3g}_{plane.aperture}"
                for k, plane in enumerate(planes)
            ]
        names = [path.with_name(f"{path.stem}_{label}{path.suffix}") for label in labels]
    maps = [name.with_name(f"{name.stem}_disparity.exr") for name in names]
    if len(pictures) == 2 * len(planes):
        left, right = pictures[::2], pictures[1::2]
        pictures = np.stack([(left + right) / 2, left, right], 1).reshape(-1, *left.shape[1:])
        names = [
            name.with_name(f"{name.stem}{half}{name.suffix}")
            for name in names for half in ("", "_left", "_right")
        ]  # fmt: skip
    if path.suffix.lower() == ".npy":
        whole = pictures[0] if len(pictures) == 1 else pictures
        write_named([(path, whole)], sensor=options.get("sensor"))
    else:
        write_named(list(zip(names, pictures, strict=True)), **options)
    if disparities is not None:
        write_named(list(zip(maps, disparities, strict=True)))
