"""A light field of the rays that a quality takes, and its error.

A pilot of about a tenth of the rays picks lens samples and rays of a pixel for the worst of the
planes that the configuration asks for; nothing else is chosen here.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.errors import OpticsError, SettingsError
from lfcore.evaluation.true_picture.reference import Reference
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.refocus.stored_depth import slice_stored
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.quality import PlannedRays, Quality, QualitySearch
from lfcore.rendering.record_depth import depth_store, record_by_depth
from lfcore.storage import defaults
from lfcore.storage.codecs import Encoding
from lfcore.storage.lightfield import LightFieldFile
from lfcore.tracing.tracer import Tracer
from lfcore.workflow.cases import given

COLUMNS = (
    "scene", "M", "quality_db", "lattice", "rays_per_pixel", "pilot_rays_per_pixel", "rays",
    "pilot_seconds", "trace_seconds", "store_seconds", "bytes", "expected_db", "psnr_true_db",
    "psnr_stored_db", "worst_plane_m", "truth_known_db",
)  # fmt: skip


@dataclass(frozen=True)
class ChosenRays:
    """What a pilot has chosen for ``planes`` through ``lens``, the widest that they ask for."""

    planned: PlannedRays
    camera: Camera
    lens: Camera
    planes: list[SensorPlane]
    pixels: int

    def pictures(self, tracer: Tracer) -> np.ndarray:
        """(P, M, M, 3) float32, linear light, formed while the rays are traced."""
        planes, count = _of_one_recording(self.planes), self.planned.lattice
        made = pictures_by_depth(tracer, self.camera, planes, self.pixels, count)
        return made[: len(self.planes)]

    def record(self, path: str | Path, tracer: Tracer, encoding: Mapping, layout: Mapping) -> int:
        """Store the rays with their depths; the file says what is expected of its pictures.

        ``encoding`` and ``layout`` are the configuration's.  Returns the bytes of the file.
        """
        spec = defaults.chosen_encoding(
            self.planned.lattice.views, Encoding(**given(encoding)), by_depth=True
        )
        settings = {"kind": "views", **given(layout)}
        slab, store = depth_store(self.lens, self.planned.lattice, self.pixels, spec, **settings)
        focus = sorted(plane.focus_m for plane in self.planes)
        expected = {"db": round(self.planned.expected_db, 2), "focus_m": [focus[0], focus[-1]]}
        record_by_depth(path, tracer, slab, store, content={"expected": expected})
        return Path(path).stat().st_size

    def stored_pictures(self, path: str | Path, tracer: Tracer) -> np.ndarray:
        """As :meth:`pictures`, from a file of :meth:`record`."""
        with LightFieldFile.open(path) as field:
            made = slice_stored(field, self.planes, device=tracer.device)
        for picture, plane in zip(made, self.planes, strict=True):
            if plane.normalise == "lens":  # the whole one, not the part that is stored
                picture *= (self.camera.f_number / self.lens.f_number) ** 2
        return made

    def row(
        self,
        reference: Reference,
        pictures: np.ndarray,
        stored: np.ndarray | None = None,
        **measured: object,
    ) -> dict:
        """Columns :data:`COLUMNS` but what ``measured`` has of them: PSNR is of the worst plane."""
        true, count = reference.psnr(pictures), self.planned.lattice
        worst = int(np.argmin(true))
        return dict.fromkeys(COLUMNS) | {
            "M": self.pixels,
            "lattice": str(count),
            "rays_per_pixel": count.rays_per_pixel,
            "pilot_rays_per_pixel": self.planned.pilot_rays,
            "rays": count.rays(self.pixels),
            "expected_db": self.planned.expected_db,
            "psnr_true_db": true[worst],
            "psnr_stored_db": None if stored is None else min(reference.psnr(stored)),
            "worst_plane_m": self.planes[worst].focus_m,
            "truth_known_db": float(reference.known_db[worst]),
            **measured,
        }


def choose_rays(
    tracer: Tracer, planes: Sequence[SensorPlane], pixels: int, quality_db: float
) -> ChosenRays:
    """Let a pilot choose.

    Raises :class:`SettingsError` for a quality that is expected to take more rays than the budget.
    """
    camera, planes = tracer.scene.camera, list(planes)
    lens = replace(camera, f_number=min(plane.f_number for plane in planes))
    try:
        together = _of_one_recording(planes)
        planned = QualitySearch(tracer, camera, together, pixels, Quality(quality_db)).plan()
    except OpticsError as error:
        if error.key != "quality_db":
            raise
        raise SettingsError(
            f"{tracer.scene.name}: {error.problem}",
            key="configuration: analysis.chosen_rays.quality_db",
            remedy=error.remedy,
        ) from None
    return ChosenRays(planned, camera, lens, planes, pixels)


def _of_one_recording(planes: list[SensorPlane]) -> list[SensorPlane]:
    """Planes whose rays are traced for all of them: one alone would be traced at its own focus."""
    return planes if len(planes) > 1 else planes * 2
