"""A sensor: photons, read noise, full well, codes, colour filter, by EMVA 1288's linear model.

Light is linear, 1 is white.  Per pixel and colour, the number of electrons is Poisson distributed
with the mean ``electrons * light`` and limited by the full well; a normally distributed read noise
is added, and ``gain`` codes per electron are rounded and limited.  So below saturation the variance
of codes is ``gain * (mean - black_level) + gain**2 * read_noise_e**2 + 1/12``.

Source: EMVA Standard 1288, release 4.0 linear, chapter 2.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import LfcoreError, OpticsError, check_kind, did_you_mean, suggest_keywords

PATTERNS = ("RGGB", "BGGR", "GRBG", "GBRG")
RAW = (".tif", ".tiff", ".dng")
"""The suffixes of files of raw codes."""
BASE_ISO = 100
"""The sensitivity at which white fills the well."""
MOST_ELECTRONS = 1e9
"""Light that frees more per pixel fills any well."""
SRGB_TO_XYZ = ((0.4124, 0.3576, 0.1805), (0.2126, 0.7152, 0.0722), (0.0193, 0.1192, 0.9505))
"""IEC 61966-2-1: the colour filters are those of linear sRGB."""


@suggest_keywords
@dataclass(frozen=True)
class Sensor:
    """A sensor that turns light into codes, with noise.

    Parameters
    ----------
    iso : float, optional
        The sensitivity; 100 fills the well at light 1, 200 half of it, with twice the gain.
        Default: 100, if ``photons`` is not given.
    photons : float, optional
        Instead of ``iso``: photons per pixel and colour at light 1.
    quantum_efficiency : float
        Electrons per photon, up to 1.
    full_well_e : float
        The most electrons of a pixel.
    read_noise_e : float
        The standard deviation of the dark signal, electrons.
    bits : int
        Bits per code, 1 to 16.
    black_level : int
        The code of no light.
    bayer : str
        The colours of the first two pixels of the first two rows, such as ``RGGB``.  Default: every
        pixel has three colours.
    seed : int
        Equal seeds, and equal numbers of pictures, give equal noise.

    Raises
    ------
    OpticsError
        A value is out of range; the error names it.

    Notes
    -----
    Noise repeats with the same version of numpy.

    Examples
    --------
    >>> sensor = lfcore.Sensor(iso=800, bits=12, read_noise_e=3, bayer="RGGB", seed=1)
    >>> raw = sensor.raw(lfcore.render(scene, pixels=16, views=2))
    >>> raw.shape, raw.dtype, bool(raw.max() < 4096)
    ((16, 16), dtype('uint16'), True)
    """

    iso: float | None = None
    photons: float | None = None
    quantum_efficiency: float = 0.6
    full_well_e: float = 15000.0
    read_noise_e: float = 2.0
    bits: int = 12
    black_level: int = 64
    bayer: str = ""
    seed: int = 0

    def __post_init__(self) -> None:
        if self.iso is not None and self.photons is not None:
            raise OpticsError("excludes photons", key="iso", remedy="Give one of them")
        for name, least, most in (
            ("iso", 1, 1e7), ("photons", 1e-3, 1e9), ("quantum_efficiency", 1e-3, 1),
            ("full_well_e", 1, 1e8), ("read_noise_e", 0, 1e6), ("bits", 1, 16),
            ("black_level", 0, 2 ** min(max(self.bits, 1), 16) - 2), ("seed", 0, 2**63),
        ):  # fmt: skip
            value, whole = getattr(self, name), name in ("bits", "black_level", "seed")
            if value is None:
                continue
            number = isinstance(value, int | np.integer if whole else int | float | np.number)
            if not number or isinstance(value, bool) or not least <= value <= most:
                kind = "a whole number" if whole else "a number"
                problem = f"must be {kind} from {least:g} to {most:g}, not {value!r}"
                raise OpticsError(problem, key=name)
        if self.bayer not in ("", *PATTERNS):
            problem = f"{self.bayer!r} is no pattern"
            raise OpticsError(problem, key="bayer", remedy=f"Use one of {', '.join(PATTERNS)}")

    @classmethod
    def of(cls, keys: Mapping[str, Any]) -> Sensor:
        """Return the sensor of a mapping; raises :class:`OpticsError`, also for unknown keys."""
        known = [each.name for each in fields(cls)]
        for key in keys:
            if key not in known:
                raise OpticsError("unknown key", key=str(key), remedy=did_you_mean(str(key), known))
        return cls(**keys)

    @property
    def electrons(self) -> float:
        """The mean number of electrons at light 1."""
        if self.photons is not None:
            return self.quantum_efficiency * self.photons
        return self.full_well_e * BASE_ISO / (self.iso or BASE_ISO)

    @property
    def white(self) -> int:
        """The greatest code."""
        return 2**self.bits - 1

    @property
    def gain(self) -> float:
        """Codes per electron: light 1, or the full well if it is filled before, is the greatest."""
        return (self.white - self.black_level) / min(self.electrons, self.full_well_e)

    def to_json(self) -> dict[str, Any]:
        """Return the parameters, with the linear model's electrons at white and gain."""
        given = {key: value for key, value in asdict(self).items() if value is not None}
        return given | {"electrons_at_white": self.electrons, "codes_per_electron": self.gain}

    def raw(self, light: np.ndarray, number: int | tuple[int, ...] = 0) -> np.ndarray:
        """Expose pictures.

        Parameters
        ----------
        light : ndarray
            (H, W, 3), or (P, H, W, 3), linear light.
        number : int or tuple of int
            The number of the picture, or of the first one: each number has its own noise.

        Returns
        -------
        ndarray
            Codes, uint16, in the shape of ``light``; with a Bayer pattern without the last axis.
        """
        check_kind(light, np.ndarray, "light", "an array of linear light")
        if light.ndim not in (3, 4) or light.shape[-1] != 3 or light.dtype.kind != "f":
            raise OpticsError(f"{light.dtype} of shape {light.shape} is no linear light")
        first = (number,) if isinstance(number, int | np.integer) else tuple(number)
        if light.ndim == 4:
            *before, last = first
            return np.stack([self.raw(one, (*before, last + k)) for k, one in enumerate(light)])
        if self.bayer:
            light = np.take_along_axis(light, self._colours(light.shape[:2])[..., None], 2)[..., 0]
        rng = np.random.Generator(
            np.random.Philox(np.random.SeedSequence(self.seed, spawn_key=first))
        )
        mean = np.clip(light.astype(np.float64) * self.electrons, 0, MOST_ELECTRONS)
        signal = np.minimum(rng.poisson(mean), self.full_well_e)
        signal = signal + self.read_noise_e * rng.standard_normal(signal.shape)
        codes = np.floor(self.gain * signal + (self.black_level + 0.5))
        return codes.clip(0, self.white).astype(np.uint16)

    def _colours(self, size: tuple[int, int]) -> np.ndarray:
        """Return the channel of each pixel, (H, W)."""
        tile = np.array(["RGB".index(letter) for letter in self.bayer]).reshape(2, 2)
        height, width = size
        return np.tile(tile, (height // 2 + 1, width // 2 + 1))[:height, :width]

    def developed(self, raw: np.ndarray) -> np.ndarray:
        """Return linear light of raw codes, (..., H, W, 3) float32, where 1 is white.

        A Bayer pattern is demosaiced by Menon's method (2007); raises :class:`LfcoreError` without
        the package colour-demosaicing.
        """
        light = (raw.astype(np.float64) - self.black_level) / (self.gain * self.electrons)
        if self.bayer:
            try:
                from colour_demosaicing import demosaicing_CFA_Bayer_Menon2007 as menon
            except ImportError:
                problem = "demosaicing needs the package colour-demosaicing"
                raise LfcoreError(problem, remedy="pip install 'lfcore[sensor]'") from None
            pictures = light.reshape(-1, *light.shape[-2:])
            light = np.stack([menon(one, self.bayer) for one in pictures])
            light = light.reshape(*raw.shape, 3)
        return light.astype(np.float32)

    def exposed(self, light: np.ndarray, number: int | tuple[int, ...] = 0) -> np.ndarray:
        """Return pictures with the sensor's noise: :meth:`developed` of :meth:`raw`."""
        return self.developed(self.raw(light, number))

    def write_raw(self, path: str | Path, raw: np.ndarray) -> None:
        """Write the codes of one picture, 16-bit TIFF or, with a Bayer pattern, DNG.

        Raises :class:`LfcoreError` for another suffix, and for DNG without the package pidng.
        """
        from lfcore.pictures import check_suffix, write_picture

        check_suffix(path, RAW)
        if Path(path).suffix.lower() != ".dng":
            write_picture(path, raw)
            return
        if not self.bayer:
            remedy = "Write a .tif, or give a pattern such as RGGB"
            raise LfcoreError("holds a Bayer pattern", file=path, key="bayer", remedy=remedy)
        self._write_dng(Path(path), raw)

    def _write_dng(self, path: Path, raw: np.ndarray) -> None:
        try:
            from pidng import core, dng
        except ImportError:
            remedy = "pip install 'lfcore[dng]', or write a .tif"
            raise LfcoreError("needs the package pidng", file=path, remedy=remedy) from None
        from lfcore.files import draft_folder

        tag, tags, (height, width) = dng.Tag, core.DNGTags(), raw.shape
        iso = round(BASE_ISO * self.full_well_e / self.electrons)
        to_camera = np.linalg.inv(SRGB_TO_XYZ)
        for name, value in {
            "ImageWidth": width, "ImageLength": height, "TileWidth": width, "TileLength": height,
            "BitsPerSample": 16, "SamplesPerPixel": 1, "Orientation": 1,
            "PhotometricInterpretation": 32803,  # a colour filter array
            "CFARepeatPatternDim": [2, 2],
            "CFAPattern": ["RGB".index(letter) for letter in self.bayer],
            "BlackLevel": self.black_level, "WhiteLevel": self.white,
            "ColorMatrix1": [[round(1e4 * m), 10000] for m in to_camera.ravel()],
            "CalibrationIlluminant1": 21,  # D65
            "AsShotNeutral": [[1, 1]] * 3, "Make": "lfcore", "Model": "Sensor",
            "PhotographicSensitivity": [min(iso, 65535)],
            "DNGVersion": [1, 4, 0, 0], "DNGBackwardVersion": [1, 2, 0, 0],
        }.items():  # fmt: skip
            tags.set(getattr(tag, name), value)
        with draft_folder(path) as folder:
            writer = core.RAW2DNG()
            writer.options(tags, path=f"{folder}/", compress=False)
            writer.convert(raw, filename="raw")
            (folder / "raw.dng").replace(path)
