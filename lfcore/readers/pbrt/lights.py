"""Converts pbrt's lights to the tracer's: point and directional lights, and a sky.

The tracer multiplies diffuse colours by irradiance without dividing by pi.  So every irradiance
here is pbrt's over pi, and a matte surface of reflectance Kd has pbrt's radiance.
"""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from lfcore.pictures import linear_light
from lfcore.readers.pbrt.parameters import COLOUR_TYPES, ParameterSet
from lfcore.readers.pbrt.spectra import parameter_rgb
from lfcore.readers.pbrt.textures import read_image
from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.baked import NO_SKY
from lfcore.scene.emitters import EmitterPoints
from lfcore.scene.limits import BRIGHTEST
from lfcore.scene.notes import LEFT_OUT
from lfcore.scene.sky import LARGEST_SIDE, octahedral
from lfcore.scene.surface_mesh import Colour, triple

ENDS = {"from": (0.0, 0.0, 0.0), "to": (0.0, 0.0, 1.0)}
"""The default points of a light's axis."""


def emitted(parameters: ParameterSet, name: str, folder: Path) -> np.ndarray:
    """Return a light's colour, (3,) linear RGB, times version 3's or 4's ``scale``."""
    parameter = parameters.get(name, *COLOUR_TYPES)
    colour = np.ones(3) if parameter is None else parameter_rgb(parameter, folder)
    scale = parameters.get("scale", "float", *COLOUR_TYPES)
    if scale is not None:
        colour = colour * parameter_rgb(scale, folder)
    return np.asarray(colour, np.float64)


CONSTANT_SIDE = 2
"""The side of a constant light's octahedral map, texels: the least for interpolation."""


class LightRig:
    """Lights in camera space, and the ``sky``, the sum of infinite lights."""

    def __init__(self, folder: Path):
        self.folder, self.lights, self.sky = folder, list[Light](), NO_SKY

    def add(self, kind: str, parameters: ParameterSet, to_camera: np.ndarray) -> None:
        """Handle ``LightSource "kind"``; ``to_camera`` is (4, 4), light space to camera space."""
        if kind in ("point", "spot"):
            self._point(kind, parameters, to_camera)
        elif kind == "distant":
            towards = _axis(parameters, to_camera, "to", "from")
            irradiance = emitted(parameters, "L", self.folder)
            if parameters.get("illuminance"):
                parameters.left_out("illuminance")
            self.lights.append(Light(DIRECTIONAL, towards, _over_pi(irradiance)))
        elif kind == "infinite":
            self._infinite(parameters, to_camera)
        else:
            parameters.note(LEFT_OUT, f'LightSource "{kind}"')
        parameters.note_unused()

    def _point(self, kind: str, parameters: ParameterSet, to_camera: np.ndarray) -> None:
        intensity = emitted(parameters, "I", self.folder)
        start = parameters.vector("from", ENDS["from"])
        position = to_camera[:3, :3] @ start + to_camera[:3, 3]
        power = parameters.float("power", 0.0)
        if power > 0:
            # Version 4: total power in watts of an isotropic source.
            intensity = intensity / max(intensity.mean(), 1e-12) * power / (4 * math.pi)
        light = Light(POINT, triple(position), _over_pi(intensity), 1.0)
        if kind == "spot":
            # pbrt's cone fades between the same angles, but with another curve.
            axis = _axis(parameters, to_camera, "from", "to")
            outer = parameters.float("coneangle", 30.0)
            inner = outer - parameters.float("conedeltaangle", 5.0)
            if not 0 < outer <= 90:
                raise parameters.error("coneangle", f"{outer:g} is no angle from 0 to 90")
            angles = (math.radians(max(angle, 0.0)) for angle in (inner, outer))
            cosines = [max(math.cos(angle), 0.0) for angle in angles]
            light = replace(light, normal=axis, cone=(cosines[0], min(cosines)))
            parameters.approximated("fades as glTF's spots")
        self.lights.append(light)

    def _infinite(self, parameters: ParameterSet, to_camera: np.ndarray) -> None:
        radiance = emitted(parameters, "L", self.folder)
        parameters.get("samples")
        parameters.get("nsamples")
        for name, places in (("mapname", _latitudes), ("filename", _equal_area)):
            file = parameters.string(name)
            if file is None:
                continue
            picture = linear_light(read_image(self.folder / file, parameters.place_of(name)))
            light = np.ascontiguousarray(picture * radiance, np.float32)
            if not (light.min() >= 0 and light.max() <= BRIGHTEST):
                problem = f"{file!r} has negative, infinite or too large values"
                raise parameters.error(name, problem, f"Give radiance from 0 to {BRIGHTEST:g}")
            side = max(2, min(picture.shape[1], LARGEST_SIDE))
            if len(self.sky) > CONSTANT_SIDE:
                side = len(self.sky)
            return self._add_sky(octahedral(light, np.linalg.inv(to_camera[:3, :3]), places, side))
        self._add_sky(np.tile(np.float32(radiance), (CONSTANT_SIDE, CONSTANT_SIDE, 1)))

    def _add_sky(self, sky: np.ndarray) -> None:
        """Add an octahedral map; a constant light's map is extended to the other's size."""
        before = self.sky if len(self.sky) else np.zeros_like(sky)
        if len(before) != len(sky):
            small, sky = sorted((before, sky), key=len)
            before = small[0, 0]
        self.sky = before + sky

    def add_area(
        self, points: EmitterPoints, radiance: np.ndarray, numbers: tuple[int, int]
    ) -> None:
        """Represent an emitting surface by point lights in camera space.

        ``numbers`` are the surface's first triangle in the scene and the one after its last.
        """
        for position, normal, area in zip(*points, strict=True):
            light = Light(POINT, triple(position), _over_pi(radiance * area), 1.0)
            self.lights.append(replace(light, normal=triple(normal), own=numbers))


def _over_pi(irradiance: np.ndarray) -> Colour:
    return triple(np.asarray(irradiance, np.float64) / math.pi)


def _latitudes(d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map directions as version 3: columns by azimuth from x to y, rows by the angle to z."""
    u = np.arctan2(d[..., 1], d[..., 0]) / (2 * math.pi) % 1.0
    return u, np.arccos(np.clip(d[..., 2], -1, 1)) / math.pi


def _equal_area(d: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Map directions as version 4.

    P. Clarberg, "Fast Equal-Area Mapping of the (Hemi)Sphere using SIMD", 2008.
    """
    x, y, z = np.moveaxis(abs(d), -1, 0)
    radius = np.sqrt(np.maximum(1 - z, 0))
    across = radius * np.arctan2(y, x) * (2 / math.pi)
    u, v = radius - across, across
    below = d[..., 2] < 0
    u, v = np.where(below, 1 - v, u), np.where(below, 1 - u, v)
    return (np.copysign(u, d[..., 0]) + 1) / 2, (np.copysign(v, d[..., 1]) + 1) / 2


def _axis(parameters: ParameterSet, to_camera: np.ndarray, start: str, end: str) -> Colour:
    """Return the unit vector in camera space between two points of :data:`ENDS`."""
    first, last = (parameters.vector(name, ENDS[name]) for name in (start, end))
    axis = to_camera[:3, :3] @ (last - first)
    length = np.linalg.norm(axis)
    if not length > 0:
        raise parameters.error("to", "coincides with from")
    return triple(axis / length)
