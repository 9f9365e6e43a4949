"""One item of a data set: its files, their arrays, and its record."""

import io
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lfcore.colour import srgb_codes
from lfcore.datasets.description import Description
from lfcore.pictures import picture_bytes
from lfcore.sensor import Sensor
from lfcore.timing import Stopwatch


@dataclass
class Item:
    """An item.

    Attributes
    ----------
    files : dict
        The files by field, in order; empty unless ``encoded``.
    arrays : dict
        The files' content by field without number: codes, or floats; lists of those with numbers.
    record : dict
        The facts of the item.
    watch : Stopwatch
        Core seconds of parts of the work.
    exposed : int
        The pictures that have a sensor's noise, so that the next one's is another.
    """

    description: Description | None = None
    encoded: bool = True
    files: dict[str, bytes] = field(default_factory=dict)
    arrays: dict[str, Any] = field(default_factory=dict)
    record: dict[str, Any] = field(default_factory=dict)
    watch: Stopwatch = field(default_factory=lambda: Stopwatch(clock=time.process_time))
    exposed: int = 0

    def codes(self, light: np.ndarray, *, noise: bool = True) -> np.ndarray:
        """Return the codes of a picture; noise is that of the description's sensor, if any."""
        description = self.description
        assert description  # refused scenes have no pictures
        if noise and description.sensor:
            sensor, self.exposed = Sensor.of(description.sensor), self.exposed + 1
            raw = sensor.raw(light, (self.record["index"], self.exposed))
            if description.codes == "raw16":
                return raw
            light = sensor.developed(raw)
        if description.codes.startswith("srgb"):
            return srgb_codes(light, bits=int(description.codes[4:]))
        return np.rint(65535 * light.clip(0, 1)).astype(np.uint16)

    def add(
        self, name: str, picture: np.ndarray, *, group: str = "", half: bool = False,
        noise: bool = True,
    ) -> None:  # fmt: skip
        """Add a file: of a picture in linear light or codes, or of numbers in EXR, PFM or NPY.

        ``group`` is the array's field in which files are stacked, by default the name without
        number; ``half`` makes half floats in three channels.
        """
        stem, _, suffix = name.rpartition(".")
        with self.watch.part("files"):
            if suffix not in ("exr", "pfm", "npy") and picture.dtype.kind == "f":
                picture = self.codes(picture, noise=noise)
            elif half:
                picture = picture.astype(np.float16)
            group = group or stem.rstrip("0123456789")
            if group == stem:
                self.arrays[group] = picture
            else:
                self.arrays.setdefault(group, []).append(picture)
            if self.encoded and suffix == "npy":
                np.save(file := io.BytesIO(), picture, allow_pickle=False)
                self.files[name] = file.getvalue()
            elif self.encoded:
                channels = np.repeat(picture[..., None], 3, 2) if half else picture
                self.files[name] = picture_bytes(f".{suffix}", channels, half=half)
