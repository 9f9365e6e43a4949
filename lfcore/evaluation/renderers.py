"""The same picture by other ray tracers: POV-Ray and Mitsuba 3 (thesis figure 4.5).

Each renders the exported scene through the same lens with the same number of rays per pixel, on
one thread; lfcore also with more rays, spread over the pixels.  The reference is lfcore's, with
far more rays, spread over pixel and lens.  A missing renderer has a row with the reason.
"""

import functools
import importlib
import math
import re
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lfcore.errors import LfcoreError, SceneError
from lfcore.evaluation.metrics import picture_quality
from lfcore.opencl.device import programs_made
from lfcore.optics.planes import SensorPlane
from lfcore.pictures import read_picture
from lfcore.rendering.direct import focused_camera, trace_picture
from lfcore.scene.mitsuba import Description, thin_lens
from lfcore.scene.model import Scene
from lfcore.scene.povray import FILE, write_mesh, write_view
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

REFERENCE_VIEWS = 20
"""The reference's lens samples per side."""
REFERENCE_PLACES = 4
"""The reference's places per pixel side: with 20 x 20 lens samples, 6400 rays per pixel."""
PLACES = 3
TIMEOUT_S = 600
ZOOM = 4
"""The enlargement of the detail, a square of 1/4 of the picture's side."""


@dataclass(frozen=True)
class Rendered:
    """A picture (M, M, 3), linear light, its rays per pixel and the seconds of rendering; if
    ``picture`` is None, ``note`` has the reason."""

    method: str
    picture: np.ndarray | None
    rays: int = 0
    seconds: float = math.nan
    note: str = ""


class NotRenderedError(LfcoreError):
    """A renderer that is not installed, or does not run."""


def compare(
    tracer: Tracer, focus_m: Sequence[float], *, pixels: int, views: int
) -> tuple[list[dict], list[list[Rendered]]]:
    """Rows of the table, and all pictures of each focus distance.

    ``views`` squared is the number of rays per pixel.  ``tracer`` should have one thread, as the
    other renderers.  PSNR and SSIM are of sRGB codes that are not rounded, peak 255.
    """
    rows, all_rendered = [], []
    scene = tracer.scene
    methods = (
        *(functools.partial(_ours, tracer, places) for places in (1, PLACES)),
        *(functools.partial(or_left_out, *peer, scene) for peer in PEERS.items()),
    )
    for focus in focus_m:
        plane = SensorPlane(focus, scene.camera.f_number)
        truth = spread_picture(tracer, plane, pixels, REFERENCE_VIEWS, REFERENCE_PLACES)
        rendered = [method(plane, pixels, views) for method in methods]
        facts = {"scene": scene.name, "M": pixels, "focus_m": focus}
        rows += [facts | _row(result, truth) for result in rendered]
        all_rendered.append(rendered)
    return rows, all_rendered


def _row(result: Rendered, truth: np.ndarray) -> dict:
    measured: dict = dict.fromkeys(("psnr_db", "ssim", "seconds", "mrays_per_second"))
    if result.picture is not None:
        measured |= picture_quality([result.picture], [truth]) | {"seconds": result.seconds}
        measured["mrays_per_second"] = truth.shape[0] ** 2 * result.rays / result.seconds / 1e6
    return {"method": result.method, "rays_per_pixel": result.rays, **measured, "note": result.note}


def spread_picture(
    tracer: Tracer, plane: SensorPlane, pixels: int, views: int, places: int
) -> np.ndarray:
    """(M, M, 3) float32, linear light: the mean over ``places`` squared places in each pixel,
    each with ``views`` squared lens samples."""
    fine = trace_picture(tracer, tracer.scene.camera, places * pixels, plane, views=views)
    return fine.reshape(pixels, places, pixels, places, 3).mean((1, 3))


def _timed(work: Callable[[], np.ndarray], method: str, rays: int, note: str) -> Rendered:
    picture, seconds = clocked_warm(work, programs_made)
    return Rendered(method, picture, rays, seconds, note)


def _ours(tracer: Tracer, places: int, plane: SensorPlane, pixels: int, views: int) -> Rendered:
    work = functools.partial(spread_picture, tracer, plane, pixels, views, places)
    method, note = "lfcore", "one place per pixel, a grid over the lens"
    if places > 1:
        method += f", {places} x {places} places per pixel"
        note = "the same grid at each place"
    return _timed(work, method, (places * views) ** 2, note)


def or_left_out(name: str, render: Callable[..., Rendered], *arguments: object) -> Rendered:
    """The picture of a renderer, or a row with the reason why there is none."""
    try:
        return render(*arguments)
    except (NotRenderedError, SceneError) as error:
        return Rendered(name, None, note=f"left out: {error}")


@functools.lru_cache(1)  # pictures of one scene follow each other
def _mesh_folder(scene: Scene) -> tempfile.TemporaryDirectory:
    """The folder of the scene's mesh for POV-Ray."""
    folder = tempfile.TemporaryDirectory(prefix="povray-")
    write_mesh(folder.name, scene)
    return folder


def povray(scene: Scene, plane: SensorPlane, pixels: int, views: int) -> Rendered:
    """POV-Ray's picture.  Seconds are its measurement, without parsing."""
    program = shutil.which("povray")
    if program is None:
        raise NotRenderedError("povray is not installed")
    folder = Path(_mesh_folder(scene).name)
    rays = views**2
    write_view(folder, scene, focused_camera(scene.camera, plane), samples=rays)
    output = folder / "out.png"
    output.unlink(missing_ok=True)
    # 16-bit PNG without a gamma curve: linear light.
    command = [
        program, f"+I{FILE}", f"+W{pixels}", f"+H{pixels}", "+WT1", "+FN16", "File_Gamma=1.0",
        f"+O{output.name}", "-D", "-A",
    ]  # fmt: skip
    try:
        process = subprocess.run(
            command, cwd=folder, capture_output=True, text=True, errors="replace",
            check=False, timeout=TIMEOUT_S,
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired) as error:
        raise NotRenderedError(f"povray does not run here: {error}") from None
    seconds = re.search(r"Trace Time:.*?\(([\d.]+) seconds\)", process.stderr)
    if process.returncode or not seconds:
        raise NotRenderedError(f"povray failed: {' '.join(process.stderr.split())[-200:]}")
    codes = read_picture(output)
    version = re.search(r"POV-Ray ([\d.]+)", process.stderr)
    picture = codes.astype(np.float32) / np.iinfo(codes.dtype).max
    note = f"POV-Ray {version[1].rstrip('.') if version else ''}, its own lens points"
    return Rendered("POV-Ray", picture, rays, float(seconds[1]), note)


def mitsuba(scene: Scene, plane: SensorPlane, pixels: int, views: int) -> Rendered:
    """Mitsuba 3's picture by its scalar variant, which runs on every processor."""
    try:
        module = importlib.import_module("mitsuba")
        module.set_variant("scalar_rgb")
        # The calling thread works, too.
        importlib.import_module("drjit").set_thread_count(0)
    except (ImportError, RuntimeError) as error:
        raise NotRenderedError(f"mitsuba is not installed, or does not run here: {error}") from None
    camera, describe = focused_camera(scene.camera, plane), Description(module, scene)
    loaded = module.load_dict(describe.all(thin_lens(module, camera, pixels)))
    note, rays = f"Mitsuba {module.__version__} scalar_rgb, random lens points", views**2
    return _timed(lambda: np.asarray(module.render(loaded, spp=rays)), "Mitsuba 3", rays, note)


PEERS = {"POV-Ray": povray, "Mitsuba 3": mitsuba}


def renderers_sheet(
    path: str | Path, rendered: Sequence[Sequence[Rendered]], focus_m: Sequence[float]
) -> None:
    """All pictures, a row per focus distance, above enlarged details."""
    from lfcore.evaluation.figures import Cell, contact_sheet, enlarged  # slow to import

    cells: list[Cell] = []
    for focus, row in zip(focus_m, rendered, strict=True):
        pictures = [(result.method, result.picture) for result in row if result.picture is not None]
        cells += [(picture, f"{method}, {focus:.3g} m") for method, picture in pictures]
        for _, picture in pictures:
            part = len(picture) // ZOOM
            detail = enlarged(picture, (len(picture) - part) // 2, part, len(picture))
            cells.append((detail, "detail"))
    contact_sheet(path, cells, len(cells) // (2 * len(focus_m)))
