"""pbrt lights as what the tracer has: point and directional lights, ambient, background.

The tracer multiplies diffuse colours by irradiance without dividing by pi, so every irradiance
here is pbrt's over pi: a matte surface of reflectance Kd then has pbrt's radiance.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from lfcore.scene.appearance import DIRECTIONAL, POINT, Light
from lfcore.scene.emitters import emitter_points
from lfcore.scene.notes import LEFT_OUT
from lfcore.scene.pbrt.parameters import COLOUR_TYPES, ParameterSet
from lfcore.scene.pbrt.spectra import parameter_rgb
from lfcore.scene.pbrt.textures import TextureTable, read_picture


@dataclass
class LightRig:
    """Lights in camera space and the light from everywhere, collected while reading."""

    lights: list[Light] = field(default_factory=list)
    ambient: np.ndarray = field(default_factory=lambda: np.zeros(3))
    background: np.ndarray = field(default_factory=lambda: np.zeros(3))


def emitted(parameters: ParameterSet, name: str, textures: TextureTable) -> np.ndarray:
    """(3,) linear RGB of a light's colour, with version 3 and 4 ``scale`` applied."""
    parameter = parameters.get(name, *COLOUR_TYPES)
    colour = np.ones(3) if parameter is None else parameter_rgb(parameter, textures.folder)
    scale = parameters.get("scale", "float", *COLOUR_TYPES)
    if scale is not None:
        colour = colour * parameter_rgb(scale, textures.folder)
    return np.asarray(colour, np.float64)


def add_light(
    rig: LightRig,
    kind: str,
    parameters: ParameterSet,
    to_camera: np.ndarray,
    textures: TextureTable,
) -> None:
    """Handle ``LightSource "kind"``; ``to_camera`` is (4, 4), light space to camera space."""
    if kind in ("point", "spot"):
        _point(rig, kind, parameters, to_camera, textures)
    elif kind == "distant":
        start = parameters.vector("from", (0, 0, 0))
        towards = to_camera[:3, :3] @ (start - parameters.vector("to", (0, 0, 1)))
        length = np.linalg.norm(towards)
        if not length > 0:
            raise parameters.error("to", "coincides with from")
        irradiance = emitted(parameters, "L", textures)
        if "illuminance" in parameters.items:
            parameters.left_out("illuminance")
            parameters.get("illuminance")
        rig.lights.append(
            Light(DIRECTIONAL, tuple((towards / length).tolist()), _over_pi(irradiance))
        )
    elif kind == "infinite":
        _infinite(rig, parameters, textures)
    else:
        parameters.note(LEFT_OUT, f'LightSource "{kind}"')
    parameters.note_unused()


def _over_pi(irradiance: np.ndarray) -> tuple[float, float, float]:
    red, green, blue = (np.asarray(irradiance, np.float64) / math.pi).tolist()
    return red, green, blue


def _point(
    rig: LightRig,
    kind: str,
    parameters: ParameterSet,
    to_camera: np.ndarray,
    textures: TextureTable,
) -> None:
    intensity = emitted(parameters, "I", textures)
    start = parameters.vector("from", (0, 0, 0))
    position = to_camera[:3, :3] @ start + to_camera[:3, 3]
    if "power" in parameters.items:
        power = parameters.float("power", 0.0)
        if power > 0:
            # Version 4: total power in watts of an isotropic source.
            intensity = intensity / max(intensity.mean(), 1e-12) * power / (4 * math.pi)
    light = Light(POINT, tuple(position.tolist()), _over_pi(intensity), 1.0)
    if kind == "spot":
        light = _spot(light, parameters, to_camera, start)
        parameters.approximated("fades as glTF's spots")
    rig.lights.append(light)


def _spot(
    light: Light, parameters: ParameterSet, to_camera: np.ndarray, start: np.ndarray
) -> Light:
    """The cone of a spot: pbrt's fades between the same angles, by another curve."""
    axis = to_camera[:3, :3] @ (parameters.vector("to", (0, 0, 1)) - start)
    length = np.linalg.norm(axis)
    if not length > 0:
        raise parameters.error("to", "coincides with from")
    outer = parameters.float("coneangle", 30.0)
    inner = outer - parameters.float("conedeltaangle", 5.0)
    if not 0 < outer <= 90:
        raise parameters.error("coneangle", f"{outer:g} is no angle from 0 to 90")
    cosines = [max(math.cos(math.radians(max(angle, 0.0))), 0.0) for angle in (inner, outer)]
    normal = tuple((axis / length).tolist())
    return replace(light, normal=normal, cone=(cosines[0], min(cosines)))


def _infinite(rig: LightRig, parameters: ParameterSet, textures: TextureTable) -> None:
    radiance = emitted(parameters, "L", textures)
    parameters.get("samples")
    parameters.get("nsamples")
    for name, octahedral in (("mapname", False), ("filename", True)):
        file = parameters.string(name)
        if file is None:
            continue
        path = textures.folder / file
        picture, encoded = read_picture(path, parameters.items[name].place)
        if encoded:
            from lfcore.colour import srgb_decode

            picture = srgb_decode(picture / 255.0)
        # Version 3 maps by latitude, whose rows shrink towards the poles; version 4's
        # octahedral map has texels of equal solid angle.
        rows = len(picture)
        weight = np.ones(rows) if octahedral else np.sin((np.arange(rows) + 0.5) / rows * math.pi)
        radiance = radiance * np.average(picture.mean(1), axis=0, weights=weight)
        parameters.approximated("the mean of its map", name)
    parameters.approximated("ambient light without shadows")
    rig.ambient = rig.ambient + radiance
    rig.background = rig.background + radiance


def add_area_light(
    rig: LightRig,
    triangles: np.ndarray,
    radiance: np.ndarray,
    two_sided: bool,
    count: int,
    own: tuple[int, int],
) -> None:
    """Let point lights stand for an emitting surface, ``count`` for each side.

    ``triangles`` (T, 3, 3) is in camera space, front side counter-clockwise; ``own`` are the first
    of them in the scene and that after the last.
    """
    points = emitter_points(triangles, count, two_sided=two_sided)
    if points is None:
        return
    for position, normal, area in zip(*vars(points).values(), strict=True):
        x, y, z = position.tolist()
        light = Light(POINT, (x, y, z), _over_pi(radiance * area), 1.0)
        rig.lights.append(replace(light, normal=tuple(normal.tolist()), own=own))
