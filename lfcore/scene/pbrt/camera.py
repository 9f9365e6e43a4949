"""pbrt cameras: ``perspective`` as a thin lens, ``lightfield`` as a camera array.

pbrt's camera space is left-handed, x right, y up, z forward; ours has y down, so the matrix
:data:`TO_OURS` is applied after pbrt's world-to-camera transform.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.scene.pbrt.notes import APPROXIMATED, LEFT_OUT, NOT_USED, Notebook
from lfcore.scene.pbrt.parameters import ParameterSet

TO_OURS = np.diag([1.0, -1.0, 1.0, 1.0])
# A sensor for pbrt's dimensionless screen: only its ratio to the image distance matters.
SENSOR_WIDTH_M = 0.036
# A pinhole is a lens of this radius: Camera wants one that exists.
PINHOLE_RADIUS_M = 1e-9
DEFAULT_FILM = (640, 480)  # version 3; version 4 has 1280 x 720


@dataclass(frozen=True)
class View:
    """What a pbrt Camera and Film ask for.

    ``array`` holds every pinhole of the film: one camera for ``perspective``, the grid for
    ``lightfield``.  ``shutter`` is (open, close) in pbrt's time.
    """

    kind: str
    camera: Camera
    array: CameraArray
    film: tuple[int, int]
    shutter: tuple[float, float]


def thin_lens(field_width: float, lens_radius: float, focus_distance: float) -> Camera:
    """The :class:`Camera` of a tangent extent, a lens radius and a focus, metres."""
    image_distance = SENSOR_WIDTH_M / field_width
    focal_length = image_distance / (1.0 + image_distance / focus_distance)
    radius = max(lens_radius, PINHOLE_RADIUS_M)
    return Camera(focal_length, SENSOR_WIDTH_M, focal_length / (2 * radius), focus_distance)


def read_film(parameters: ParameterSet | None, notebook: Notebook) -> tuple[int, int]:
    """(width, height) in pixels; the crop window is left out and noted."""
    if parameters is None:
        return DEFAULT_FILM
    size = tuple(
        parameters.integer(name, default)
        for name, default in zip(("xresolution", "yresolution"), DEFAULT_FILM, strict=True)
    )
    if min(size) < 1:
        raise parameters.error("xresolution", f"of {size[0]} x {size[1]} is no film")
    if parameters.get("cropwindow"):
        notebook.add(LEFT_OUT, parameters.place, f"crop window of {parameters.owner}")
    parameters.note_unused(notebook)
    return size


def read_camera(
    kind: str, parameters: ParameterSet, film: tuple[int, int], notebook: Notebook
) -> View:
    """Handle ``Camera "kind"``; an unknown kind becomes ``perspective``, noted.

    Raises
    ------
    SceneError : parameters that make no camera.
    """
    if kind not in ("perspective", "lightfield"):
        notebook.add(APPROXIMATED, parameters.place, f'{parameters.owner}: as "perspective"')
    shutter = (parameters.float("shutteropen", 0.0), parameters.float("shutterclose", 1.0))
    maker = _lightfield if kind == "lightfield" else _perspective
    view = maker(parameters, film, shutter, notebook)
    parameters.note_unused(notebook)
    return view


def _fov(parameters: ParameterSet) -> float:
    degrees = parameters.float("fov", 90.0)
    half = parameters.float("halffov", 0.0)
    degrees = 2 * half if half > 0 else degrees
    if not 0 < degrees < 180:
        raise parameters.error("fov", f"must be between 0 and 180 degrees, not {degrees}")
    return degrees


def _perspective(parameters, film, shutter, notebook) -> View:
    fov = _fov(parameters)
    if parameters.get("screenwindow"):
        notebook.add(LEFT_OUT, parameters.place, f"screen window of {parameters.owner}")
    if parameters.get("frameaspectratio"):
        notebook.add(LEFT_OUT, parameters.place, f"frame aspect ratio of {parameters.owner}")
    if film[0] != film[1]:
        notebook.add(
            APPROXIMATED,
            parameters.place,
            f"film of {film[0]} x {film[1]}: a light slab has its square middle, the array all",
        )
    radius = parameters.float("lensradius", 0.0)
    focus = parameters.float("focaldistance", 1e6 if radius > 0 else math.inf)
    if radius < 0 or not focus > 0:
        raise parameters.error("lensradius", "and focaldistance must not be negative")
    camera = thin_lens(2 * math.tan(math.radians(fov) / 2), radius, focus)
    return View("perspective", camera, CameraArray.single(fov, film), film, shutter)


def _lightfield(parameters, film, shutter, notebook) -> View:
    fov = _fov(parameters)
    counts = parameters.floats("camerasperdim", 2)
    counts = (16, 16) if counts is None else tuple(int(count) for count in counts)
    if min(counts) < 1:
        raise parameters.error("camerasperdim", f"must be at least 1 1, not {counts}")
    bounds = parameters.floats("cameragridbounds", 4)
    bounds = (-0.6, 0.6, -0.6, 0.6) if bounds is None else tuple(bounds.tolist())
    # Not in the assignment, whose "equally spaced within the bounds" can be read both ways.
    spacing = parameters.string("spacing", "ends")
    for length, count, name in zip(film, counts, ("width", "height"), strict=True):
        if length % count:
            raise parameters.error(
                "camerasperdim",
                f"divides a film {name} of {length} into {count} tiles with a remainder",
                "Make the film a multiple of the cameras",
            )
    tile = (film[0] // counts[0], film[1] // counts[1])
    array = CameraArray.on_grid(counts, bounds, fov, tile, spacing)
    for name in ("lensradius", "focaldistance"):
        if parameters.get(name):
            notebook.add(NOT_USED, parameters.place, f'"{name}": data cameras are pinholes')
    half = max(abs(bound) for bound in bounds)
    camera = thin_lens(array.field_width, half, math.inf)
    return View("lightfield", camera, array, film, shutter)
