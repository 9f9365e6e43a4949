"""All points of one scene: traced, stored, and by Mitsuba 3 and POV-Ray.

The cost of a light field file is that of recording, reading and forming all planes.

The peers' seconds are for a quality against each peer's own true picture: their shading differs (no
ambient light in Mitsuba, no Blinn-Phong), so a common truth would measure that difference and not
the error of sampling.  They trace every picture separately, with independent samples over
pixel and lens: squared error falls with the number of samples.  A small picture with few samples
therefore predicts the cost of a large picture with many.
"""

import itertools
import math
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import lfcore
from lfcore.errors import OpticsError
from lfcore.evaluation.renderers.comparison import PEERS
from lfcore.evaluation.renderers.rendered import Rendered, or_left_out
from lfcore.evaluation.true_picture import Reference, inner_psnr
from lfcore.evaluation.work_precision.in_memory import memory_rows
from lfcore.evaluation.work_precision.points import (
    COLUMNS,
    FROM_FILE,
    ON_THE_FLY,
    point,
    refused_point,
    timed_point,
)
from lfcore.opencl.device import Device, programs_made
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice, Slab
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import trace_planes
from lfcore.rendering.prepared import hierarchy_of
from lfcore.rendering.quality import Quality, QualitySearch
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.timing import clocked_warm
from lfcore.tracing.tracer import Tracer

NEAREST, BY_DEPTH, TO_QUALITY = "nearest pixel", "by depth", "by depth, to a quality"


def nearest_rows(tracer: Tracer, reference: Reference, views: Sequence[int]) -> Iterator[dict]:
    """The thesis's recipe: N x N lens samples, all rays through the middle of their pixel."""
    for n in views:
        slab = Slab.of(tracer.scene.camera, n, reference.size)
        work = partial(trace_planes, tracer, slab, reference.planes)
        yield timed_point(
            reference, work, tracer.device, panel=ON_THE_FLY, method=NEAREST, setting=f"{n} x 1",
            rays=slab.rays,
        )  # fmt: skip


def by_depth_rows(
    tracer: Tracer, reference: Reference, lattices: Sequence[Lattice]
) -> Iterator[dict]:
    """Few rays, each spread by its depth: traced once for all planes."""
    camera, planes, pixels = tracer.scene.camera, reference.planes, reference.size
    for lattice in lattices:
        work = partial(pictures_by_depth, tracer, camera, planes, pixels, lattice)
        yield timed_point(
            reference, work, tracer.device, panel=ON_THE_FLY, method=BY_DEPTH,
            setting=str(lattice), rays=lattice.rays(pixels),
        )  # fmt: skip


def quality_rows(
    tracer: Tracer, reference: Reference, qualities_db: Sequence[float]
) -> Iterator[dict]:
    """The rays that a quality needs."""
    planes, pixels = reference.planes, reference.size
    for quality_db in qualities_db:
        job = QualitySearch(tracer, tracer.scene.camera, planes, pixels, Quality(quality_db))
        context = {"panel": ON_THE_FLY, "method": TO_QUALITY, "setting": f"{quality_db:g} dB"}
        clock = tracer.device.clock
        try:
            result, seconds = clocked_warm(job.pictures, programs_made, clock=clock)
        except OpticsError as error:
            yield refused_point(reference, error, **context)
            continue
        yield point(
            reference, result.pictures, rays=result.lattice.rays(pixels), seconds=seconds,
            expected_db=float(result.expected_db.min()), **context,
        )  # fmt: skip


def recording_seconds(scene: Scene, file: str | Path, device: Device, **how: Any) -> float:
    """Record as :func:`lfcore.record`; the clock counts rays and frames, not the tree."""
    hierarchy_of(scene)
    record = partial(lfcore.record, scene, file, device=device, **how)
    _, seconds = clocked_warm(lambda: record().close(), programs_made, clock=device.clock)
    return seconds


def recorded_row(
    scene: Scene,
    reference: Reference,
    lattice: Lattice,
    device: Device,
    *,
    method: str = BY_DEPTH,
    setting: str = "",
    encoding: Encoding | None = None,
) -> dict:
    """A row of the rays ``lattice`` with their depths, recorded to a file and read again.

    ``setting``, the name of the point, is ``lattice`` by default.
    """
    with tempfile.TemporaryDirectory() as folder:
        file, size = Path(folder) / "lightfield.mkv", reference.size
        seconds = recording_seconds(
            scene, file, device, views=lattice, pixels=size, encoding=encoding
        )

        def read() -> np.ndarray:
            with lfcore.LightField.open(file) as field:
                return field.refocus_many(reference.planes, device=device)

        return timed_point(
            reference, read, device, panel=FROM_FILE, method=method,
            setting=setting or str(lattice), rays=lattice.rays(size),
            record_seconds=seconds, bytes=file.stat().st_size,
        )  # fmt: skip


def codec_rows(
    scene: Scene,
    reference: Reference,
    lattice: Lattice,
    codecs: Sequence[Mapping],
    crfs: Sequence[float],
    device: Device,
) -> Iterator[dict]:
    """Rows of the same rays by codec and CRF; ``crf_offset`` of a codec is added to its CRF."""
    for codec in codecs:
        keys = ("codec", "preset", "pixel_format")
        settings = {key: codec[key] for key in keys if codec.get(key) is not None}
        for crf in crfs:
            crf = float(crf + codec.get("crf_offset", 0))
            yield recorded_row(
                scene, reference, lattice, device, method=f"{lattice}, {codec['name']}",
                setting=f"CRF {crf:g}", encoding=Encoding(crf=crf, **settings),
            )  # fmt: skip


def traced_grid(reference: Reference, views: int, pictures: np.ndarray, traced: Mapping) -> dict:
    """The row of the workflow's own pictures of N = ``views``, formed while tracing.

    ``traced`` is the record of the tracing.
    """
    return point(
        reference, pictures, panel=ON_THE_FLY, method=NEAREST, setting=f"{views} x 1",
        rays=traced["rays"], seconds=traced["seconds"],
    )  # fmt: skip


def grid_row(
    reference: Reference, views: int, pictures: np.ndarray, jobs: Sequence[Mapping]
) -> dict:
    """The row of the workflow's own light field of N = ``views`` without depth.

    ``pictures`` are formed from the file; ``jobs`` are the records of tracing, storing and
    retrieving it.
    """
    traced, stored, retrieved = jobs
    return point(
        reference, pictures, panel=FROM_FILE, method=NEAREST, setting=f"{views} x 1",
        rays=traced["rays"], seconds=retrieved["seconds"] * retrieved["threads"],
        record_seconds=traced["seconds"] + stored["encode_seconds"] + stored["join_seconds"],
        bytes=stored["video_bytes"],
    )  # fmt: skip


PIXELS = 24
"""The side of the pictures that are rendered; time is proportional to the number of pixels."""
SAMPLES = 4
"""The samples per pixel side of the measured pictures."""
TRUE_SAMPLES = 16
"""The samples per pixel side of the true picture: 16 times as many samples, 12 dB less error."""


def peer_rows(
    scene: Scene,
    planes: Sequence[SensorPlane],
    pixels: Pixels,
    targets_db: Sequence[float],
    *,
    peers: dict[str, Callable[..., Rendered]] = PEERS,
) -> Iterator[dict]:
    """A row per renderer and target: predicted samples and seconds for all planes together.

    ``expected_db`` is the target.  A renderer that is not installed, or cannot show the scene, has
    one row whose ``note`` says why.
    """
    area = math.prod(Size.of(pixels))
    dark = replace(scene, ambient=(0.0, 0.0, 0.0))
    for method, renderer in peers.items():
        context = {"panel": ON_THE_FLY, "f_number": planes[0].f_number, "method": method}
        sampled, note = _sampled(method, renderer, dark, planes)
        if note:
            yield dict.fromkeys(COLUMNS) | context | {"note": note}
            continue
        for target in targets_db:
            samples = [
                math.ceil(SAMPLES**2 * 10 ** ((target - psnr_db) / 10)) for psnr_db, _ in sampled
            ]
            per_sample = [seconds * area for _, seconds in sampled]
            yield dict.fromkeys(COLUMNS) | context | {
                "setting": f"{target:g} dB", "rays_per_pixel": sum(samples),
                "rays": sum(samples) * area, "expected_db": target,
                "seconds": float(np.dot(samples, per_sample)),
            }  # fmt: skip


def _sampled(
    name: str, renderer: Callable[..., Rendered], scene: Scene, planes: Sequence[SensorPlane]
) -> tuple[list[tuple[float, float]], str]:
    """For each plane the PSNR in dB of a few samples, and the seconds per pixel and sample; or
    nothing, and the reason."""
    by_plane = []
    for plane in planes:
        arguments = name, renderer, scene, plane, PIXELS
        few, true = (or_left_out(*arguments, side) for side in (SAMPLES, TRUE_SAMPLES))
        if few.picture is None or true.picture is None:
            return [], few.note or true.note
        # The measured difference includes the truth's own error, of 16 times as many samples.
        difference_db = inner_psnr(*(np.asarray(result.picture, float) for result in (few, true)))
        sampling_db = difference_db + 10 * math.log10(1 + (SAMPLES / TRUE_SAMPLES) ** 2)
        by_plane.append((sampling_db, true.seconds / TRUE_SAMPLES**2 / PIXELS**2))
    return by_plane, ""


def scene_rows(
    tracer: Tracer, wide: Reference, stopped: Reference, grids: Iterable[dict], study: Mapping
) -> list[dict]:
    """The rows of a scene, with the columns of :mod:`~lfcore.evaluation.work_precision.points`.

    ``wide`` and ``stopped`` are the true pictures through the open lens and the stopped-down one,
    ``grids`` the rows of the workflow's own light fields, ``study`` the keys of
    ``analysis.work_precision``.
    """
    scene, device = tracer.scene, tracer.device
    lattices = [Lattice(int(views), subpixels) for views, subpixels in study["lattices"]]
    views, subpixels = study["codec_lattice"]
    stored = Lattice(int(views), subpixels)
    parts: list[Iterable[dict]] = [
        grids,
        nearest_rows(tracer, stopped, study["nearest_views"]),
        *(by_depth_rows(tracer, reference, lattices) for reference in (wide, stopped)),
        *(quality_rows(tracer, reference, study["qualities_db"]) for reference in (wide, stopped)),
        peer_rows(scene, wide.planes, wide.size, study["peers_db"]),
        (recorded_row(scene, wide, lattice, device) for lattice in lattices),
        codec_rows(scene, wide, stored, study["codecs"], study["crfs"], device),
        memory_rows(tracer, wide, study["memory_views"], study["monte_carlo_samples"]),
    ]
    return [{**row, "scene": scene.name} for row in itertools.chain(*parts)]
