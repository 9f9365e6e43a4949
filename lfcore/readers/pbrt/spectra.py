"""Converts colours of pbrt scenes, rgb, xyz, blackbody and sampled spectra, to linear sRGB.

The colour matching functions are the multi-lobe fits of Wyman, Sloan and Shirley, "Simple
Analytic Approximations to the CIE XYZ Color Matching Functions", JCGT 2(2), 2013; blackbody is
Planck's law.
"""

from pathlib import Path

import numpy as np

from lfcore.errors import SceneError
from lfcore.readers.pbrt.parameters import Parameter
from lfcore.reading import LARGEST_DESCRIPTION, read_bytes

# IEC 61966-2-1
XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)
COLDEST = 100.0
"""The lowest temperature of a blackbody, K: below, its visible light underflows in float64."""
HOTTEST = 1e7
"""The highest temperature of a blackbody, K: above, its colour is constant."""
_WAVELENGTHS = np.arange(380.0, 781.0, 2.0)  # nm

# The reflectance of polished metals at normal incidence, linear RGB, for spectra given by name
# (e.g. Lagarde, "Memo on Fresnel equations", 2013).
METALS = {
    "Cu": (0.955, 0.638, 0.538),
    "Au": (1.000, 0.782, 0.344),
    "Ag": (0.972, 0.960, 0.915),
    "Al": (0.913, 0.922, 0.924),
}


def _lobe(x: np.ndarray, mean: float, left: float, right: float) -> np.ndarray:
    return np.exp(-0.5 * ((x - mean) * np.where(x < mean, left, right)) ** 2)


def matching_functions(wavelength_nm: np.ndarray) -> np.ndarray:
    """Return CIE 1931 x, y, z bar at the wavelengths, (n, 3) float64, Wyman et al. equation 4."""
    w = np.asarray(wavelength_nm, np.float64)
    x = (
        0.362 * _lobe(w, 442.0, 0.0624, 0.0374)
        + 1.056 * _lobe(w, 599.8, 0.0264, 0.0323)
        - 0.065 * _lobe(w, 501.1, 0.0490, 0.0382)
    )
    y = 0.821 * _lobe(w, 568.8, 0.0213, 0.0247) + 0.286 * _lobe(w, 530.9, 0.0613, 0.0322)
    z = 1.217 * _lobe(w, 437.0, 0.0845, 0.0278) + 0.681 * _lobe(w, 459.0, 0.0385, 0.0725)
    return np.stack([x, y, z], -1)


def spectrum_to_rgb(wavelength_nm: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Convert a piecewise linear spectrum to linear RGB, (3,) float64; constant 1 is white."""
    samples = np.interp(_WAVELENGTHS, wavelength_nm, values)
    bars = matching_functions(_WAVELENGTHS)
    rgb = XYZ_TO_RGB @ (bars * samples[:, None]).sum(0)
    white = XYZ_TO_RGB @ bars.sum(0)
    return np.maximum(rgb / white, 0.0)


def blackbody(kelvin: float) -> np.ndarray:
    """Return linear RGB of Planck's law at ``kelvin``, normalised to a greatest radiance of one."""
    metres = _WAVELENGTHS * 1e-9
    with np.errstate(over="ignore"):
        radiance = metres**-5 / np.expm1(1.438776877e-2 / (metres * kelvin))
    peak = 2.897771955e-3 / kelvin
    highest = peak**-5 / np.expm1(1.438776877e-2 / (peak * kelvin))
    return spectrum_to_rgb(_WAVELENGTHS, radiance / highest)


def metal_reflectance(eta: np.ndarray, k: np.ndarray) -> np.ndarray:
    """Return the reflectance of a conductor at normal incidence (Fresnel)."""
    return ((eta - 1) ** 2 + k**2) / ((eta + 1) ** 2 + k**2)


def read_spd(path: Path, parameter: Parameter) -> tuple[np.ndarray, np.ndarray]:
    """Read wavelengths and values of a spectrum file: two columns, ``#`` comments."""
    try:
        text = read_bytes(path, LARGEST_DESCRIPTION).decode()
        rows = np.loadtxt(text.splitlines(), ndmin=2, comments="#")
        return rows[:, 0], rows[:, 1]
    except (SceneError, ValueError, IndexError) as error:
        reason = getattr(error, "problem", error)
        problem = f"spectrum file {str(path)!r} cannot be read: {reason}"
        raise parameter.place.error(problem) from None


def parameter_rgb(parameter: Parameter, folder: Path) -> np.ndarray:
    """Convert a colour parameter of any type to linear RGB, (3,) float64."""
    values, kind = parameter.values, parameter.type
    if kind in ("rgb", "color", "xyz"):
        if len(values) != 3:
            raise parameter.place.error(f'"{kind} {parameter.name}" needs 3 numbers')
        return np.maximum(XYZ_TO_RGB @ values, 0.0) if kind == "xyz" else np.asarray(values)
    if kind == "blackbody":
        scale = float(values[1]) if len(values) > 1 else 1.0
        if not COLDEST <= values[0] <= HOTTEST:
            problem = f"a blackbody cannot have {values[0]:g} K"
            raise parameter.place.error(problem, f"Give {COLDEST:g} to {HOTTEST:g} K")
        return blackbody(float(values[0])) * scale
    if kind == "spectrum" and isinstance(values, list):
        return spectrum_to_rgb(*read_spd(folder / values[0], parameter))
    if kind == "spectrum":
        if len(values) % 2:
            raise parameter.place.error("a spectrum needs pairs of wavelength and value")
        return spectrum_to_rgb(values[::2], values[1::2])
    if kind == "float" and len(values) == 1:
        return np.repeat(values, 3)
    raise parameter.place.error(f'"{kind} {parameter.name}" is not a colour')
