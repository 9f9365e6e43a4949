"""Values of options: each function reads one, checks its range and names what is allowed."""

import argparse
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from lfcore.colour import MOST_EV
from lfcore.errors import OpticsError
from lfcore.optics.focus import blur_share, check_place, check_words
from lfcore.optics.planes import HALVES, SHAPES
from lfcore.optics.size import Size
from lfcore.sensor import Sensor
from lfcore.storage.codecs import CODECS
from lfcore.storage.pixels import PIXEL_FORMATS


def count(least: int = 1, most: int | None = None) -> Callable[[str], int]:
    """Make a type for argparse: a whole number in a range."""
    allowed = f"from {least} to {most}" if most is not None else f"of at least {least}"

    def read(text: str) -> int:
        try:
            value = int(text)
        except ValueError:
            value = least - 1
        if value < least or (most is not None and value > most):
            raise argparse.ArgumentTypeError(f"{text!r} is not a whole number {allowed}")
        return value

    return read


def number(
    least: float = -math.inf, most: float = math.inf, *, above: bool = False
) -> Callable[[str], float]:
    """Make a type for argparse: a finite number in a range; ``above`` excludes the lower end."""
    low = f" above {least:g}" if above else f" from {least:g}" if least > -math.inf else ""
    high = f" to {most:g}" if most < math.inf else ""

    def read(text: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not (least <= value <= most and math.isfinite(value)) or (above and value == least):
            raise argparse.ArgumentTypeError(f"{text!r} is not a number{low}{high}")
        return value

    return read


positive = number(0, above=True)
angle = number(0, 179, above=True)
views = count(1, 4096)


def pixels(text: str) -> int | Size:
    """Read the side of a square, or width and height: ``512``, ``1920x1080``."""
    size = _checked(text, "size", Size.of)
    return size if "x" in text or "\u00d7" in text else size.width


def distance(text: str) -> float:
    """Read metres above 0; ``inf`` is infinity."""
    return math.inf if text.lower() in ("inf", "infinity") else positive(text)


def pair(text: str) -> tuple[int, int]:
    """Read two counts: ``9x9``."""
    match = re.fullmatch(r"(\d+)[x\u00d7](\d+)", text)
    if not match or not all(int(part) for part in match.groups()):
        raise argparse.ArgumentTypeError(f"{text!r} is not two counts like 9x9")
    return int(match[1]), int(match[2])


def window(text: str) -> tuple[int, int, int, int]:
    """Read left, top, width and height of ``WxH+X+Y``."""
    match = re.fullmatch(r"(\d+)x(\d+)\+(\d+)\+(\d+)", text)
    if not match:
        raise argparse.ArgumentTypeError(f"{text!r} is not a window like 512x512+0+0")
    width, height, left, top = (int(part) for part in match.groups())
    return left, top, width, height


def length(text: str) -> float:
    """Read a length in metres: ``6mm``, ``0.6cm``, ``0.006m`` or ``0.006``."""
    units = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}
    for unit, metres in units.items():
        if text.endswith(unit):
            return positive(text.removesuffix(unit)) * metres
    return positive(text)


def exposure(text: str) -> dict[str, Any]:
    """Read stops, and whether highlights roll off: ``-1.5``, ``0:soft``."""
    stops, _, highlights = text.partition(":")
    if highlights not in ("", "soft"):
        raise argparse.ArgumentTypeError(f"{highlights!r} is not soft")
    return {"exposure_ev": number(-MOST_EV, MOST_EV)(stops), "roll_off": highlights == "soft"}


def rays(text: str) -> tuple[int | None, int | None]:
    """Read rays per pixel and instants of the shutter: ``64``, ``64:4`` or ``:4``."""
    samples, _, instants = text.partition(":")
    read = count()
    return read(samples) if samples else None, read(instants) if instants else None


MOST_FRAMES = 1_000_000
"""The most frames of a film: twelve hours at 24 per second."""


def frames(text: str) -> range:
    """Read the frames of a film, the last excluded: ``0:48``."""
    first, _, end = text.partition(":")
    numbers = range(count(0)(first), count(0)(end))
    if not numbers:
        raise argparse.ArgumentTypeError(f"{text!r} has no frame")
    if numbers[-1] - numbers[0] >= MOST_FRAMES:
        raise argparse.ArgumentTypeError(f"{text!r} has more than {MOST_FRAMES:,} frames")
    return numbers


def shutter(text: str) -> tuple[float, float]:
    """Read when a shutter opens and closes, seconds from the instant: ``0:0.02``."""
    opened, _, closed = text.partition(":")
    times = number()(opened), number()(closed)
    if times[1] < times[0]:
        raise argparse.ArgumentTypeError(f"{text!r} closes before it opens")
    return times


def codec(*keys: str) -> Callable[[str], dict[str, str]]:
    """Make a type for argparse: ``libx265,preset=medium``, as keywords of :class:`lfcore.Encoding`.

    Keys are ``preset``, ``pixel_format`` and ``keys``.
    """
    choices = {"codec": tuple(CODECS), "preset": (), "pixel_format": tuple(PIXEL_FORMATS),
             "layout": ("macropixels", "views")}  # fmt: skip

    def read(text: str) -> dict[str, str]:
        keywords = {}
        for part in text.split(","):
            key, value = part.split("=", 1) if "=" in part else ("codec", part)
            if key not in ("codec", "preset", "pixel_format", *keys):
                raise argparse.ArgumentTypeError(f"unknown key {key!r}")
            if choices[key] and value not in choices[key]:
                names = ", ".join(choices[key])
                raise argparse.ArgumentTypeError(f"{key} {value!r} is not one of {names}")
            keywords[key] = value
        return keywords

    return read


def _checked(text: str, kind: str, check: Callable[[str], Any]) -> Any:
    """Convert a text with a function of the library; argparse reports its error."""
    try:
        return check(text)
    except OpticsError as error:
        reason = error.remedy or f"It {error.problem}"
        raise argparse.ArgumentTypeError(f"{text!r} is no {kind}. {reason}") from None


# Settings of a sensor plane, as keywords of :meth:`lfcore.LightField.plane`.


def focus(text: str) -> dict[str, Any]:
    """Read a focus: metres, ``inf``, ``near``, ``middle``, ``far``, ``40%`` of the visible depth,
    or ``1.5px``, the disparity of neighbouring views."""
    if text.endswith("px"):
        return {"disparity_px": number()(text.removesuffix("px"))}
    word = _checked(text, "focus", check_words)
    return {"focus_m": word if isinstance(word, str) else distance(text)}


def pull(text: str) -> dict[str, Any]:
    """Read a focus as :func:`focus`, or one at the beginning and one at the end: ``2:6``."""
    first, colon, last = text.partition(":")
    return {"pull": [focus(first), focus(last)]} if colon else focus(text)


def place(text: str) -> dict[str, Any]:
    """Read a place in the picture to focus on: ``0.5,0.4``."""
    split = lambda words: check_place(words.strip("[]()").split(","))  # noqa: E731
    return {"focus_at": _checked(text, "place", split)}


def blur(text: str) -> dict[str, Any]:
    """Read an aperture's blur, relative to the picture's shorter side: ``3%``."""
    return {"blur": _checked(text, "blur", blur_share)}


def f_number(text: str) -> dict[str, float]:
    """Read an f-number, or ``7views``, the aperture's diameter in views."""
    if text.endswith("views"):
        return {"aperture_views": positive(text.removesuffix("views"))}
    return {"f_number": positive(text)}


def aperture(text: str) -> dict[str, Any]:
    """Read an aperture: ``circle``, ``square``, ``diamond``, or ``polygon:BLADES:DEGREES``; one of
    their halves: ``square:left``, or ``left`` of the circle."""
    *whole, half = text.split(":")
    if half in HALVES:
        return aperture(":".join(whole) or "circle") | {"half": half}
    shape, *more = text.split(":")
    if shape not in SHAPES or len(more) > 2 or (more and shape != "polygon"):
        shapes = ", ".join(SHAPES)
        problem = (
            f"{text!r} is not one of {shapes}, or left, right, top or bottom; a polygon may be "
            "polygon:5 or polygon:5:18, a half square:left"
        )
        raise argparse.ArgumentTypeError(problem)
    settings: dict[str, Any] = {"aperture": shape}
    if more:
        settings["blades"] = count(3)(more[0])
    if more[1:]:
        settings["rotation_deg"] = number()(more[1])
    return settings


def sensor(text: str) -> Sensor:
    """Read a sensor: ``iso=1600,bits=10,bayer=RGGB``."""
    keys: dict[str, Any] = {}
    for setting in text.split(","):
        key, equals, value = setting.partition("=")
        number = re.fullmatch(r"[-+]?\d+", value)
        try:
            keys[key] = value if key == "bayer" else int(value) if number else float(value)
        except ValueError:
            wrong = "is no number" if equals else "lacks a value"
            raise argparse.ArgumentTypeError(f"{setting!r} {wrong}") from None
    try:
        return Sensor.of(keys)
    except OpticsError as error:
        raise argparse.ArgumentTypeError(str(error).removesuffix(".")) from None


def truth(text: str) -> bool:
    """Read ``yes``, ``true`` or ``1``; ``no``, ``false`` or ``0``."""
    values = {"true": True, "yes": True, "1": True, "false": False, "no": False, "0": False}
    if text.lower() not in values:
        raise argparse.ArgumentTypeError(f"{text!r} is neither yes nor no")
    return values[text.lower()]


def sky(text: str) -> dict[str, Any]:
    """Keys of a scene.yaml, of ``FILE`` or ``#rrggbb`` with ``bounces``, ``rotation_deg``,
    ``strength``."""
    source, *settings = text.split(",")
    keys: dict[str, Any] = {}
    if source:
        is_colour = source.startswith("#")
        keys["sky"] = {"colour": source} if is_colour else {"file": str(Path(source).resolve())}
    for setting in settings:
        key, _, value = setting.partition("=")
        if key == "bounces":
            keys[key] = value if value == "all" else count(0)(value)
        elif key in ("rotation_deg", "strength") and source:
            keys["sky"][key] = number()(value)
        else:
            problem = f"{setting!r} is none of bounces, rotation_deg, strength"
            raise argparse.ArgumentTypeError(problem)
    return keys
