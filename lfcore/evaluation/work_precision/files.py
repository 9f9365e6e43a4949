"""Pictures from light field files: the cost of recording, reading and forming all planes."""

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np

import lfcore
from lfcore.evaluation.true_picture import Reference
from lfcore.evaluation.work_precision.on_the_fly import BY_DEPTH, NEAREST
from lfcore.evaluation.work_precision.points import (
    FROM_FILE,
    ON_THE_FLY,
    core_clock,
    point,
    timed_point,
)
from lfcore.opencl.device import Device, programs_made
from lfcore.optics.lattice import Lattice
from lfcore.rendering.prepared import hierarchy_of
from lfcore.scene.model import Scene
from lfcore.storage.codecs import Encoding
from lfcore.timing import clocked_warm


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
    hierarchy_of(scene)  # the clock counts rays and frames, not the tree
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "lightfield.mkv"

        def record() -> None:
            lfcore.record(
                scene, file, views=lattice, pixels=reference.size, encoding=encoding,
                device=device,
            ).close()  # fmt: skip

        def read() -> np.ndarray:
            with lfcore.LightField.open(file) as field:
                return field.refocus_many(reference.planes, device=device)

        _, seconds = clocked_warm(record, programs_made, clock=core_clock(device))
        return timed_point(
            reference, read, device, panel=FROM_FILE, method=method,
            setting=setting or str(lattice), rays=lattice.rays(reference.size),
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
        own = ("codec", "preset", "pixel_format")
        settings = {key: codec[key] for key in own if codec.get(key) is not None}
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
