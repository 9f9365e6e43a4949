"""Pictures from the book's light field: steps 3, 4 and 5 of the assignment.

Each study returns a sheet of pictures (size, size, 3) and the measurements.
"""

import math
from functools import partial
from pathlib import Path

import numpy as np

from lfcore.evaluation.assignment.arrays import errors, read_field
from lfcore.evaluation.figures import Sheet
from lfcore.opencl.device import Device, programs_made
from lfcore.optics.lens_system import LensSystem
from lfcore.refocus.array import focal_surface as surfaces
from lfcore.refocus.array.device_field import DeviceField
from lfcore.refocus.array.synthesis import isaksen, monte_carlo, realistic
from lfcore.refocus.array.virtual_camera import VirtualCamera
from lfcore.timing import clocked_warm

BOOK_FOCUS_M = 6.8
"""The focus of the assignment's command line, metres."""
AUTHORS_FOCUS_M = 6.2
"""The focus of the authors' line, metres."""
BOOK_COVER = {"point": (0.160, -0.398, 7.181), "normal": (0.2669, -0.6641, -0.6984)}
"""A point of the book's cover and its normal, camera space (y down), metres."""
BOOK_LENS_M = 0.2
"""The lens radius in measurements, metres: all rays of lens and filter hit the camera grid."""
FILTER_M = 0.3
"""The filter radius of the assignment's command line, metres."""
LENS_M = 0.15
"""The lens radius that blurs about as much as the filter's cone, metres."""
SAMPLES = 64
"""The rays per pixel of Monte Carlo."""


def assignment_camera(size: int, lens_radius_m: float = 0.0) -> VirtualCamera:
    """The virtual camera of the assignment's command line, size x size pixels."""
    return VirtualCamera.from_pbrt(
        (-0.15, -0.2, -1.2), (0, 0, 0), 40.0, (size, size), lens_radius_m
    )


def measured_camera(size: int) -> VirtualCamera:
    """The book's camera where pictures are measured: between the data cameras."""
    return VirtualCamera(np.array([-0.06, 0.05, 0.0]), np.eye(3), 40.0, (size, size), BOOK_LENS_M)


def book(
    device: Device, *, light_field: str | Path, lens: str | Path, picture_px: int
) -> tuple[list[Sheet], dict]:
    """Sheets of the three steps, and measurements of two.

    ``light_field`` is the book's array, a tiled EXR; ``lens`` a lens file.
    """
    field = read_field(device, light_field)
    synthesised, synthesis_record = synthesis(field, picture_px)
    through_lens, lens_record = realistic_lens(field, picture_px, lens)
    record = {"synthesis": synthesis_record, "realistic_lens": lens_record}
    return [synthesised, focal_surfaces(field, picture_px), through_lens], record


def synthesis(field: DeviceField, size: int) -> tuple[Sheet, dict]:
    """Isaksen's filter at two focal planes and Monte Carlo at the second; steps 3 and 4."""
    pinhole, lens = assignment_camera(size), assignment_camera(size, LENS_M)
    at_book, near = surfaces.parallel(BOOK_FOCUS_M), surfaces.parallel(AUTHORS_FOCUS_M)
    methods = {
        f"Isaksen, z = {BOOK_FOCUS_M} m": partial(isaksen, field, pinhole, at_book, FILTER_M),
        f"Isaksen, z = {AUTHORS_FOCUS_M} m": partial(isaksen, field, pinhole, near, FILTER_M),
        f"Monte Carlo, z = {AUTHORS_FOCUS_M} m": partial(monte_carlo, field, lens, near, SAMPLES),
    }
    results = {name: clocked_warm(method, programs_made) for name, method in methods.items()}
    pictures = [result.image for result, _ in results.values()]
    record = {
        "seconds": [seconds for _, seconds in results.values()],
        "skipped_share": [result.skipped_share for result, _ in results.values()],
        "psnr_of_methods_db": errors(pictures[1], pictures[2])["psnr_db"],
        "samples": SAMPLES,
        "filter_m": FILTER_M,
        "lens_m": LENS_M,
    }
    return Sheet(list(zip(pictures, results, strict=True))), record


def focal_surfaces(field: DeviceField, size: int) -> Sheet:
    """One light field, four surfaces: the first bonus."""
    camera = VirtualCamera(np.array([0.0, 0.0, 0.0]), np.eye(3), 44.0, (size, size), 0.35)
    ticks = np.arange(2 * size) / 2 + 0.25
    x, y = np.meshgrid(*camera.film_tangents(ticks, ticks))
    # Both planes contain a point of the cover; only the tilted plane contains the cover.
    point, normal = np.array(BOOK_COVER["point"]), np.array(BOOK_COVER["normal"])
    by_name: dict[str, surfaces.FocalSurface] = {
        "plane, parallel": surfaces.parallel(float(point[2])),
        "plane in the book's cover": surfaces.PlaneSurface(point, normal),
        "sphere, far side at 7.2 m": surfaces.SphereSurface(np.array([0.0, 0.0, 4.2]), 3.0),
        "function: near in the middle": surfaces.DepthMapSurface(5.6 + 14.0 * (x * x + y * y)),
    }
    cells = (
        (monte_carlo(field, camera, surface, SAMPLES).image, name)
        for name, surface in by_name.items()
    )
    return Sheet(list(cells), 2)


def realistic_lens(field: DeviceField, size: int, file: str | Path) -> tuple[Sheet, dict]:
    """The second bonus: a double Gauss, open and stopped down, and the equivalent thin lens."""
    lens = LensSystem.read(file)
    length = float(lens.focal_length_m)
    diagonal = 0.9 * length
    # The front of the glass is in the data cameras' plane; the film is behind it.
    film_z = -float(lens.focused(BOOK_FOCUS_M + 2.0).positions_m[0])
    sharp = lens.focused(AUTHORS_FOCUS_M - film_z)
    camera = VirtualCamera(np.array([0.0, 0.0, film_z]), np.eye(3), 40.0, (size, size))
    surface = surfaces.parallel(AUTHORS_FOCUS_M)
    full = 2 * float(lens.aperture_m[lens.radius_m == 0][0])
    cells = []
    for part in (1.0, 0.5, 0.25):
        stopped = sharp.stopped_down(full * part)
        result = realistic(field, camera, stopped, surface, SAMPLES, film_diagonal_m=diagonal)
        cells.append((result.image, f"double Gauss, stop {1000 * full * part:.0f} mm"))
    f_number = lens.focused(math.inf).working_f_number
    radius = length / f_number / 2
    image_m = sharp.image_distance_m
    # The thin lens is in the front principal plane: film and focus are conjugate about it.
    place = np.array([0.0, 0.0, AUTHORS_FOCUS_M - length * image_m / (image_m - length)])
    fov_deg = math.degrees(2 * math.atan(diagonal / math.sqrt(8) / image_m))
    thin = VirtualCamera(place, np.eye(3), fov_deg, (size, size), radius)
    result = monte_carlo(field, thin, surface, SAMPLES)
    cells.append((result.image, f"thin lens of {2000 * radius:.0f} mm"))
    corners = [float(picture[: size // 8, -(size // 8) :].mean()) for picture, _ in cells]
    record = {"focal_length_m": length, "f_number": f_number}
    record["corner_light_open"] = corners[0] / corners[-1]
    record["corner_light_stopped"] = corners[2] / corners[-1]
    return Sheet(cells, 2), record
