"""pbrt cameras: ``perspective`` as a thin lens, ``lightfield`` as a camera array.

pbrt's camera space is left-handed, x right, y up, z forward; ours has y down, so the matrix
:data:`TO_OURS` is applied after pbrt's world-to-camera transform.
"""

import math
from dataclasses import replace
from typing import Any

import numpy as np

from lfcore.errors import OpticsError
from lfcore.optics.array import CameraArray, thin_lens
from lfcore.readers.pbrt.parameters import ParameterSet
from lfcore.scene.notes import NOT_USED
from lfcore.scene.view import FOV_DEG, LIGHTFIELD, PERSPECTIVE, SHUTTER, View, lightfield_view

TO_OURS = np.diag([1.0, -1.0, 1.0, 1.0])
"""The matrix from pbrt's camera space to ours."""
DEFAULT_FILM = (640, 480)
"""The width and height, pixels, of version 3's film; version 4 has 1280 x 720."""
DEFAULT_SAMPLES = 16
"""The rays per pixel of pbrt's samplers."""
LARGEST_FILM = 65536
"""The longest side of a film, pixels."""
MOST_SAMPLES = 65536
"""The most rays per pixel."""
PARAMETERS = {
    "cameras_per_dim": "camerasperdim",
    "bounds": "cameragridbounds",
    "cameras": "camerasperdim",
    "spacing": "spacing",
    "shutter": "shutterclose",
}
"""pbrt's parameter of each key in errors of the optics; all other keys depend on ``fov``."""


def read_film(parameters: ParameterSet | None) -> tuple[int, int]:
    """Return (width, height) in pixels; a crop window is left out and noted."""
    if parameters is None:
        return DEFAULT_FILM
    width, height = DEFAULT_FILM
    size = parameters.integer("xresolution", width), parameters.integer("yresolution", height)
    if min(size) < 1 or max(size) > LARGEST_FILM:
        problem = f"and yresolution make a film of {size[0]} x {size[1]}"
        raise parameters.error("xresolution", problem, f"Give 1 to {LARGEST_FILM}")
    if parameters.get("cropwindow"):
        parameters.left_out("crop window")
    parameters.note_unused()
    return size


def read_samples(parameters: ParameterSet | None) -> int:
    """Return a Sampler's rays per pixel: ``pixelsamples``, or the product of a grid's sides."""
    if parameters is None:
        return DEFAULT_SAMPLES
    count = parameters.integer("pixelsamples", 0)
    if not count:
        grid = [parameters.integer(name, 0) for name in ("xsamples", "ysamples")]
        count = math.prod(grid) or DEFAULT_SAMPLES
    if not 1 <= count <= MOST_SAMPLES:
        raise parameters.error("pixelsamples", f"must be from 1 to {MOST_SAMPLES}, not {count}")
    return count


def read_camera(kind: str, parameters: ParameterSet, film: tuple[int, int], samples: int) -> View:
    """Handle ``Camera "kind"``; an unknown kind becomes ``perspective``, which is noted."""
    if kind not in (PERSPECTIVE, LIGHTFIELD):
        parameters.approximated('as "perspective"')
    opened = parameters.float("shutteropen", SHUTTER[0])
    closed = parameters.float("shutterclose", SHUTTER[1])
    maker = _lightfield if kind == LIGHTFIELD else _perspective
    try:
        view = maker(parameters, film)
        view = replace(view, shutter=(opened, closed), samples_per_pixel=samples)
    except OpticsError as error:
        name = PARAMETERS.get(error.key or "", "fov")
        raise parameters.error(name, error.problem, error.remedy) from None
    parameters.note_unused()
    return view


def _fov(parameters: ParameterSet) -> float:
    degrees = parameters.float("fov", FOV_DEG)
    half = parameters.float("halffov", 0.0)
    return 2 * half if half > 0 else degrees


def _perspective(parameters: ParameterSet, film: tuple[int, int]) -> View:
    array = CameraArray.single(_fov(parameters), film)
    for name, words in (
        ("screenwindow", "screen window"),
        ("frameaspectratio", "frame aspect ratio"),
    ):
        if parameters.get(name):
            parameters.left_out(words)
    radius = parameters.float("lensradius", 0.0)
    focus = parameters.float("focaldistance", 1e6 if radius > 0 else math.inf)
    if radius < 0 or not focus > 0:
        raise parameters.error("lensradius", "and focaldistance must not be negative")
    camera = thin_lens(array.field_width, radius, focus)
    return View(PERSPECTIVE, camera, array, film, lens_radius_m=radius)


def _lightfield(parameters: ParameterSet, film: tuple[int, int]) -> View:
    grid: dict[str, Any] = {}
    if (counts := parameters.floats("camerasperdim", 2)) is not None:
        grid["cameras_per_dim"] = tuple(int(count) for count in counts)
    if (bounds := parameters.floats("cameragridbounds", 4)) is not None:
        grid["grid_bounds_m"] = tuple(bounds.tolist())
    # Our addition: the assignment's "equally spaced within the bounds" is ambiguous.
    grid["spacing"] = parameters.string("spacing", "ends")
    for name in ("lensradius", "focaldistance"):
        if parameters.get(name):
            parameters.note(NOT_USED, f'"{name}": data cameras are pinholes')
    return lightfield_view(film, _fov(parameters), **grid)
