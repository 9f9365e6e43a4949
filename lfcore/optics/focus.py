"""Focus and blur relative to the visible depth, for models with an arbitrary unit of length.

A focus is a distance in metres, or a word about the depths in the picture: ``near``, ``middle``,
``far``, or a share of the way such as ``40%``.  A blur is a share of the picture's shorter side.
Neither changes when a scene is scaled.
"""

import math
from collections.abc import Sequence
from numbers import Real
from typing import NamedTuple

import numpy as np

from lfcore.errors import OpticsError, check_kind

ENDS = (2.0, 98.0)
"""The percentiles of the visible depths that are the near end and the far end."""
SHARES = {"near": 0.0, "middle": 0.5, "far": 1.0}
"""The words for a focus, and their shares of the way from the near end to the far end."""
REMEDY = "Give metres, inf, near, middle, far, or a share of the visible depth such as 40%"
WIDEST_BLUR = 1.0
"""The widest blur, relative to the picture's shorter side."""


class DepthRange(NamedTuple):
    """The nearest and the farthest depth in a picture, metres along the axis.

    Attributes
    ----------
    near_m, far_m : float
        The far end may be ``math.inf``.
    """

    near_m: float
    far_m: float

    @property
    def middle_m(self) -> float:
        """The depth whose blur is the same when the near or the far end is in focus."""
        return self.at(0.5)

    def at(self, share: float) -> float:
        """The depth at a share of the way from near (0) to far (1), linear in dioptres; metres."""
        if share in (0.0, 1.0):
            return self.far_m if share else self.near_m
        delta = (1.0 - share) / self.near_m + share / self.far_m
        return 1.0 / delta if delta else math.inf

    def defocus(self, focus_m: float) -> float:
        """The dioptres between ``focus_m`` and the end of the range that is more out of focus."""
        return max(abs(1.0 / end - 1.0 / focus_m) for end in self)

    def ends(self) -> dict[str, float]:
        """The distances of the ends and the middle, metres, by their words."""
        return {name: self.at(share) for name, share in SHARES.items()}

    def __str__(self) -> str:
        return ", ".join(f"{name} {distance:.4g} m" for name, distance in self.ends().items())


def ends_of(depths: np.ndarray) -> DepthRange | None:
    """The ends of visible depths, metres, without the outermost 2 percent; None without depths."""
    if not len(depths):
        return None
    near, far = np.percentile(depths, ENDS).tolist()
    return DepthRange(near, far)


def exclude_twice(**settings: object) -> None:
    """Raise :class:`OpticsError` if more than one of these settings is not None."""
    names = [name for name, value in settings.items() if value is not None]
    if len(names) > 1:
        raise OpticsError(f"excludes {names[0]}", key=names[1], remedy="Leave one out")


def check_words(focus: float | str) -> float | str:
    """The focus as a number of metres if it is one, else the checked word."""
    if not isinstance(focus, str):
        return focus
    text = focus.strip().lower()
    try:
        return float(text)
    except ValueError:
        share_of(text)
        return text


def share_of(word: str) -> float:
    """The share of the way from near to far that a word names; raises :class:`OpticsError`."""
    if word in SHARES:
        return SHARES[word]
    share = _percent(word)
    if share is None or not 0 <= share <= 1:
        raise OpticsError(f"cannot be {word!r}", key="focus_m", remedy=REMEDY)
    return share


def focus_distance(focus: float | str, seen: DepthRange | None) -> float:
    """The distance of a focus, metres; a word refers to the visible depths ``seen``, if known."""
    focus = check_words(focus)
    if not isinstance(focus, str):
        check_kind(focus, Real, "focus_m", "a number of metres or a word")
        return float(focus)
    if seen is None:
        problem = f"{focus!r} needs the visible depth, which is not known"
        raise OpticsError(problem, key="focus_m", remedy="Give metres")
    return seen.at(share_of(focus))


def check_place(place: Sequence[float | str]) -> tuple[float, float]:
    """A place in the picture, (x, y) from 0 to 1; raises :class:`OpticsError` outside."""
    try:
        x, y = map(float, place)
    except (TypeError, ValueError):
        x = y = math.nan
    if not (0 <= x <= 1 and 0 <= y <= 1):
        remedy = "Give x and y from 0 to 1, from the upper left corner"
        raise OpticsError(f"{place} is no place in the picture", key="focus_at", remedy=remedy)
    return x, y


def check_surface(depth_m: float, place: tuple[float, float]) -> float:
    """Return the depth at a place of the picture; raise :class:`OpticsError` for a miss."""
    if math.isfinite(depth_m):
        return depth_m
    problem = "no surface is seen at {:g},{:g} of the picture".format(*place)
    remedy = "Give the place of a surface: 0,0 is the upper left corner, 1,1 the lower right one"
    raise OpticsError(problem, key="focus_at", remedy=remedy)


def blur_share(blur: float | str) -> float:
    """A blur such as ``"3%"`` or 0.03, relative to the picture's shorter side."""
    try:
        share = _percent(blur) if isinstance(blur, str) and "%" in blur else float(blur)
    except (TypeError, ValueError):
        share = None
    if share is None or not 0 < share <= WIDEST_BLUR:
        problem = f"must be above 0 and at most 100% of the picture's shorter side, not {blur}"
        raise OpticsError(problem, key="blur", remedy="Give a share such as 3%")
    return share


def f_number_of_blur(
    blur: float | str, focal_m: float, focus_m: float, width: float, seen: DepthRange | None
) -> float:
    """The f-number of the aperture that blurs by a share of the picture's shorter side.

    A lens of diameter A images a point at depth z as a disc of the tangent A |1/z - 1/focus|.
    Here z is the nearest or the farthest visible depth, whichever is more out of focus.
    ``width`` is the field's tangent extent.
    """
    share = blur_share(blur)
    defocus = seen.defocus(focus_m) if seen else 0.0
    if not defocus > 1e-6 / focal_m * share * width:
        problem = "nothing visible can be out of focus"
        raise OpticsError(problem, key="blur", remedy="Give an f-number")
    return focal_m * defocus / (share * width)


def _percent(text: str) -> float | None:
    """The number of a percentage, 0.4 for ``40%``; None for any other text."""
    number, sign, rest = text.strip().partition("%")
    try:
        return float(number) / 100 if sign and not rest else None
    except ValueError:
        return None
