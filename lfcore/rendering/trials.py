"""The rate factor of a codec for a quality of pictures, from small light fields of the same scene.

A trial is stored with a rate factor and sliced by depth.  The difference of its pictures to those
of a lossless trial is the codec's error.  In dB the error is about linear in the rate factor, so
two trials predict the factor, and a third measures the chosen one.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from lfcore.colour import srgb_encode
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.size import Pixels, Size
from lfcore.optics.slab import Lattice, Slab
from lfcore.refocus.stored_depth import slice_stored
from lfcore.rendering.depth import seen_range
from lfcore.rendering.first_look import inner
from lfcore.rendering.quality import Quality, QualitySearch, planes_between
from lfcore.rendering.record_depth import depth_store, record_by_depth
from lfcore.storage.codecs import LOSSLESS, WHOLE_ROWS, Encoding
from lfcore.storage.defaults import CRF_SCALE, chosen_encoding
from lfcore.storage.lightfield import LightFieldFile
from lfcore.tracing.tracer import Tracer

PIXELS = 96
"""The approximate longer side of a trial's pictures, pixels."""
CRFS = 14.0, 26.0
"""The rate factors of the first trials, of H.264."""
BEST = 6.0
"""The least rate factor that is chosen, of H.264."""
WORST = 40.0
"""The greatest rate factor that is chosen, of H.264."""
OF_RAYS = 0.75
"""The rays' share of the mean squared error; the rest is the codec's."""


def share_db(quality_db: float, share: float) -> float:
    """The PSNR of a share of a quality's error."""
    return quality_db - 10 * math.log10(share)


def together_db(*parts_db: float) -> float:
    """The PSNR of the sum of independent errors."""
    return -10 * math.log10(sum(10 ** (-part / 10) for part in parts_db))


@dataclass(frozen=True)
class Trials:
    """Trials of a light field of ``lattice`` for pictures of ``pixels``, focused at ``planes``."""

    tracer: Tracer
    camera: Camera
    lattice: Lattice
    pixels: Pixels
    planes: Sequence[SensorPlane]
    encoding: Encoding
    peak: float | None = None

    def chosen(self, codec_db: float) -> tuple[float, float]:
        """The rate factor for pictures of ``codec_db``, and the PSNR in dB that it gives."""
        scale = CRF_SCALE.get(self.encoding.codec, 1.0)
        few, many = (factor * scale for factor in CRFS)
        first, second = self.codec_db(few), self.codec_db(many)
        crf = few + (first - codec_db) * (many - few) / max(first - second, 1e-6)
        crf = round(min(max(crf, BEST * scale), WORST * scale), 1)
        return crf, self.codec_db(crf)

    def codec_db(self, crf: float) -> float:
        """PSNR in dB, sRGB, of the worst picture against those of a lossless trial."""
        pictures = self._pictures(replace(self.encoding, crf=crf))
        errors = np.square(inner(pictures) - inner(self._lossless)).mean(axis=(1, 2, 3))
        return -10 * math.log10(max(float(errors.max()), 1e-10))

    @cached_property
    def _lossless(self) -> np.ndarray:
        form, transfer = "gbrp" if self.peak is None else "yuv444p12le", self.encoding.transfer
        exact = Encoding(LOSSLESS[0], form, tune=None, gop=self.encoding.gop, transfer=transfer)
        return self._pictures(exact)

    def _pictures(self, spec: Encoding) -> np.ndarray:
        """(P, H, W, 3) sRGB-encoded pictures of a trial."""
        lattice, size = self._small
        slab, store = depth_store(self.camera, lattice, size, spec, peak=self.peak)
        with TemporaryDirectory() as folder:
            path = Path(folder) / "trial.mkv"
            record_by_depth(path, self.tracer, slab, store)
            with LightFieldFile.open(path) as field:
                return srgb_encode(slice_stored(field, self.planes, device=self.tracer.device))

    @cached_property
    def _small(self) -> tuple[Lattice, Size]:
        """A lattice and size of fewer pixels with the same rays per pixel.

        Encoders treat both widths alike.
        """
        size, per_pixel = Size.of(self.pixels), self.lattice.subpixels
        side = self.lattice.side(size.longer)
        if size.longer <= PIXELS:
            return self.lattice, size
        if side % WHOLE_ROWS == 0:
            small = WHOLE_ROWS * max(1, round(per_pixel * PIXELS / WHOLE_ROWS))
        else:
            small = 8 * math.ceil(per_pixel * PIXELS / 8)
            small += 8 * (small % WHOLE_ROWS == 0)
        pixels = max(8, round(small / per_pixel))
        return replace(self.lattice, subpixels=small / pixels), size.scaled(pixels)


def plan_quality(
    tracer: Tracer,
    camera: Camera,
    size: Size,
    quality: Quality,
    encoding: Encoding,
    peak: float | None,
) -> tuple[Lattice, Encoding, dict]:
    """The lattice that one view chooses, the encoding that trials choose, and their expected dB."""
    near_far = quality.focus_range_m or seen_range(tracer, Slab.of(camera, 4, size))
    planes = planes_between(camera, *(near_far or (math.inf, math.inf)))
    crf_is_free = encoding.crf is None and not encoding.lossless
    search = QualitySearch(tracer, camera, planes, size, quality)
    lattice = search.plan(share_db(0.0, OF_RAYS) if crf_is_free else 0.0)
    rays_db = float(search.look.expected_db(lattice.views, lattice.subpixels).min())
    width = Slab.of(camera, lattice, size).size.width
    spec = chosen_encoding(lattice.views, encoding, by_depth=True, width=width)
    expected = {"focus_m": [planes[0].focus_m, planes[-1].focus_m]}
    if encoding.lossless:
        return lattice, encoding, expected | {"db": round(rays_db, 2)}
    trials = Trials(tracer, camera, lattice, size, planes, spec, peak)
    if encoding.crf is None:
        crf, codec_db = trials.chosen(share_db(quality.quality_db, 1 - OF_RAYS))
        encoding = replace(encoding, crf=crf)
    else:
        codec_db = trials.codec_db(encoding.crf)
    db = together_db(rays_db, codec_db)
    return lattice, encoding, expected | {"db": round(db, 2), "codec_db": round(codec_db, 2)}
