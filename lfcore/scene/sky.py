"""Skies: the radiance of rays that miss the scene, and the light of a sky.

A sky is an octahedral map in camera space, (S, S, 3) float32 linear radiance: direction d is at
d.xy / (|d.x| + |d.y| + |d.z|); directions behind the camera are folded outward over the edges
(T. Engelhardt and C. Dachsbacher, "Octahedron Environment Maps", VMV 2008).
"""

from __future__ import annotations

import io
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from lfcore.errors import LfcoreError, SceneError
from lfcore.pictures import decode, picture_size
from lfcore.reading import read_bytes
from lfcore.scene.appearance import DIRECTIONAL, Light

if TYPE_CHECKING:
    from lfcore.reading import Where
    from lfcore.scene.model import Scene

MOST_TEXELS = 2**26
"""The most texels of a panorama: 768 MiB of float32 RGB."""
LARGEST_FILE = 1 << 30
"""The largest file of a panorama, bytes."""
LARGEST_SIDE = 2048
"""The largest side of a map, texels."""
GRADIENT_SIDE = 256
"""The side of the map of a gradient, texels."""
Places = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
SUNS = 8
"""The most suns of a sky: each costs a shadow ray per hit."""
WIDEST_SPOT = 0.02
"""The largest solid angle of a small bright spot, steradians."""
SPOT_CONTRAST = 10.0
"""The least radiance of a spot's texels, in mean radiances of the sky beside the spots."""
SUN_CONTRAST = 50.0
"""The least mean radiance of a sun, in the same unit."""
LEAST_SUN = 0.01
"""The least share of a sun in the sky's light."""
SPREAD = 0.2
"""The radius, in radians, of the cap over which the light of lesser bright spots is spread."""
SPREAD_SIDE = 64
"""The side of the map on which it is spread, texels."""


def octahedron(places: np.ndarray) -> np.ndarray:
    """(..., 3) unit directions of places (..., 2) on a map that reaches from -1 to 1."""
    x, y = places[..., 0], places[..., 1]
    z = 1 - abs(x) - abs(y)
    fold = np.maximum(-z, 0)
    d = np.stack([x - np.copysign(fold, x), y - np.copysign(fold, y), z], -1)
    return d / np.sqrt((d * d).sum(-1, keepdims=True))


def texel_directions(side: int) -> np.ndarray:
    """(S, S, 3) unit directions of the middles of a map's texels."""
    axis = (np.arange(side) + 0.5) / side * 2 - 1
    return octahedron(np.stack(np.meshgrid(axis, axis), -1))


def radiance(sky: np.ndarray, directions: np.ndarray) -> np.ndarray:
    """(R, 3) float32 radiance of a sky in ``directions`` (R, 3), bilinear."""
    d, side = np.asarray(directions, np.float32), len(sky)
    size = abs(d)
    d = d / (size[:, 0] + size[:, 1] + size[:, 2])[:, None]
    x, y = d[:, 0], d[:, 1]
    behind = d[:, 2] < 0
    u = np.where(behind, np.copysign(1 - abs(y), x), x)
    v = np.where(behind, np.copysign(1 - abs(x), y), y)
    at = [np.clip((axis * np.float32(0.5) + np.float32(0.5)) * side - np.float32(0.5), 0, side - 1)
          for axis in (u, v)]  # fmt: skip
    i, j = (np.minimum(axis.astype(np.int64), side - 2) for axis in at)
    f, g = ((axis - low).astype(np.float32)[:, None] for axis, low in zip(at, (i, j), strict=True))
    flat, first = sky.reshape(-1, 3), j * side + i
    top = flat[first] + f * (flat[first + 1] - flat[first])
    first += side
    return top + g * (flat[first] + f * (flat[first + 1] - flat[first]) - top)


def solid_angles(side: int) -> np.ndarray:
    """(S, S) steradians of a map's texels."""
    axis = (np.arange(side) + 0.5) / side * 2 - 1
    x, y = np.meshgrid(axis, axis)
    z = 1 - abs(x) - abs(y)
    fold = np.maximum(-z, 0)
    square = (abs(x) - fold) ** 2 + (abs(y) - fold) ** 2 + z**2
    return (2 / side) ** 2 / square**1.5


@dataclass(frozen=True)
class _Spots:
    """Small bright spots of a map.

    ``texels`` (K,) are flat indices, ``number`` (K,) the spots they belong to and ``floor`` (K,)
    the radiance of the sky around.  ``flux`` (n, 3) is what spots give beyond that, ``towards``
    (n, 3) their unit directions and ``size`` (n,) their solid angles.
    """

    texels: np.ndarray
    number: np.ndarray
    floor: np.ndarray
    flux: np.ndarray
    towards: np.ndarray
    size: np.ndarray


def suns(sky: np.ndarray) -> tuple[np.ndarray, list[Light]]:
    """The sky without its small bright spots, and a directional light for each large one of them.

    Rays to the whole sky would hardly ever hit them: a shadow ray samples each sun, and the light
    of lesser spots is spread around them.
    """
    light, angles = sky.mean(-1, dtype=np.float64), solid_angles(len(sky))
    level = _level(light, angles)
    spots = _bright_spots(sky, light, level)
    if spots is None:
        return sky, []
    power = spots.flux.mean(1)
    large = power >= LEAST_SUN * (light * angles).sum()
    bright = power >= SUN_CONTRAST * level * spots.size
    chosen = np.flatnonzero(large & bright)
    chosen = chosen[np.argsort(-power[chosen], kind="stable")][:SUNS]
    kept = large & ~bright
    rest, gone = sky.copy(), ~kept[spots.number]
    texels = spots.texels[gone]
    darker = spots.floor[gone] / light.ravel()[texels]
    rest.reshape(-1, 3)[texels] *= darker.astype(np.float32)[:, None]
    lesser = ~kept
    lesser[chosen] = False
    if lesser.any():
        rest += _spread(spots.flux[lesser], spots.towards[lesser], len(sky))
    return rest, [_sun(spots, number) for number in chosen.tolist()]


def _sun(spots: _Spots, number: int) -> Light:
    colour = tuple((spots.flux[number] / math.pi).tolist())
    radius = math.sqrt(spots.size[number] / math.pi)
    towards = tuple(spots.towards[number].tolist())
    return Light(DIRECTIONAL, towards, colour, angular_radius=radius)


def _level(light: np.ndarray, angles: np.ndarray) -> float:
    """The mean radiance beside texels of :data:`SPOT_CONTRAST` times as much."""
    beside, level = np.ones(light.shape, bool), math.inf
    while True:
        lower = float((light * angles)[beside].sum() / angles[beside].sum())
        if not lower < level:
            return level
        level, beside = lower, light <= SPOT_CONTRAST * lower


def _bright_spots(sky: np.ndarray, light: np.ndarray, level: float) -> _Spots | None:
    """Spots of more than :data:`SPOT_CONTRAST` times the ``level``; of wide ones, the parts that
    are twice, four times, ... as bright."""
    labels, floor, angles = np.zeros(light.shape, np.int64), light * 0, solid_angles(len(sky))
    around, least = level, SPOT_CONTRAST * level
    inside = light > least
    while inside.any():
        found = _components(inside)
        small = inside & (np.bincount(found.ravel(), angles.ravel()) <= WIDEST_SPOT)[found]
        labels[small] = found[small] + labels.max()
        floor[small] = around
        around, least = least, 2 * least
        inside = inside & ~small & (light > least)
    texels = np.flatnonzero(labels)
    if not len(texels):
        return None
    number = np.unique(labels.ravel()[texels], return_inverse=True)[1]
    floor, size = floor.ravel()[texels], angles.ravel()[texels]
    flux = sky.reshape(-1, 3)[texels] * ((1 - floor / light.ravel()[texels]) * size)[:, None]
    middles = (np.stack(np.unravel_index(texels, light.shape)[::-1], -1) + 0.5) / len(sky) * 2 - 1
    towards = octahedron(middles) * flux.mean(-1, keepdims=True)
    columns = np.concatenate([flux, towards, size[:, None]], 1).T
    sums = np.stack([np.bincount(number, values) for values in columns], -1)
    length = np.sqrt((sums[:, 3:6] ** 2).sum(-1, keepdims=True))
    return _Spots(texels, number, floor, sums[:, :3], sums[:, 3:6] / length, sums[:, 6])


def _components(mask: np.ndarray) -> np.ndarray:
    """The numbers (S, S), from 1, of connected parts of a mask; 0 is none."""
    import cv2  # loaded for skies alone

    labels = cv2.connectedComponents(mask.astype(np.uint8))[1]
    for edge in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        for one, other in zip(edge, edge[::-1], strict=True):  # the map's fold joins their texels
            if one and other and one != other:
                labels[labels == other] = one
    return labels


def _spread(flux: np.ndarray, towards: np.ndarray, side: int) -> np.ndarray:
    """(side, side, 3) float32: the light (n, 3) of spots in directions (n, 3), over caps."""
    texels, angles = texel_directions(SPREAD_SIDE).reshape(-1, 3), solid_angles(SPREAD_SIDE).ravel()
    added = np.zeros((len(texels), 3))
    for some in np.array_split(np.arange(len(flux)), max(1, len(flux) >> 8)):
        share = np.maximum(towards[some] @ texels.T - math.cos(SPREAD), 0)
        added += (share / (share @ angles)[:, None]).T @ flux[some]
    small = rounded(added).astype(np.float32).reshape(SPREAD_SIDE, SPREAD_SIDE, 3)
    at = np.clip((np.arange(side) + 0.5) / side * SPREAD_SIDE - 0.5, 0, SPREAD_SIDE - 1)
    low = np.minimum(at.astype(np.int64), SPREAD_SIDE - 2)
    share = (at - low).astype(np.float32)[:, None, None]
    rows = small[low] + share * (small[low + 1] - small[low])
    columns = rows.swapaxes(0, 1)
    return (columns[low] + share * (columns[low + 1] - columns[low])).swapaxes(0, 1)


def rounded(values: np.ndarray) -> np.ndarray:
    """Round to 12 bits, because libraries' last bits differ between processors."""
    mantissa, exponent = np.frexp(values)
    return np.ldexp(np.rint(mantissa * 4096) / 4096, exponent)


def with_sky(
    scene: Scene, description: dict, to_camera: np.ndarray, *, file: str | Path,
    gradient_side: int = GRADIENT_SIDE,
) -> Scene:  # fmt: skip
    """The scene under the checked ``sky`` of a scene.yaml, and lit by its suns; ``to_camera`` turns
    the world, y up."""
    # Imported here: modules that make the kernels' header import this one.
    from lfcore.reading import Where
    from lfcore.scene.surface_mesh import parse_colour

    strength, file = description.get("strength", 1.0), Path(file)
    if "file" in description:
        where = Where(file, "sky.file")
        panorama = _read_panorama(file.parent / description["file"], where) * np.float32(strength)
        side = max(2, min(panorama.shape[1], LARGEST_SIDE))
    elif "colour" in description:
        colour = np.multiply(parse_colour(description["colour"]), strength)
        return under(scene, np.tile(np.float32(colour), (2, 2, 1)))
    else:
        ends = [
            np.multiply(parse_colour(description[end]), strength) for end in ("horizon", "zenith")
        ]
        # Above the horizon, radiance is linear in the sine of the elevation; below, it is constant.
        rows = (np.arange(gradient_side) + 0.5) / gradient_side
        up = np.maximum(np.cos(rows * math.pi), 0)[:, None]
        column = (ends[0] + up * (ends[1] - ends[0])).astype(np.float32)
        panorama, side = np.repeat(column[:, None], 2 * gradient_side, axis=1), gradient_side
    turned = math.radians(description.get("rotation_deg", 0.0))
    places = partial(panorama_places, turned=turned)
    return under(scene, octahedral(panorama, to_camera[:3, :3].T, places, side))


def under(scene: Scene, sky: np.ndarray) -> Scene:
    """The scene with a sky and the light of its suns."""
    return replace(scene, sky=sky, lights=[*scene.lights, *suns(sky)[1]])


def octahedral(picture: np.ndarray, to_world: np.ndarray, places: Places, side: int) -> np.ndarray:
    """Turn a picture (H, W, 3) of all directions into an octahedral map.

    ``to_world`` (3, 3) rotates camera space to the world; ``places`` maps world directions to the
    picture.
    """
    import cv2  # loaded for skies alone

    radiances, (height, width) = np.zeros((side, side, 3), np.float32), picture.shape[:2]
    rays = picture.shape[1] // side + 2
    within = (np.arange(rays) + 0.5) / rays
    for row in range(side):
        y = (row + within) / side * 2 - 1
        x = (np.arange(side)[:, None] + within).ravel() / side * 2 - 1
        world = octahedron(np.stack(np.broadcast_arrays(x, y[:, None]), -1)) @ to_world.T
        world /= np.sqrt((world * world).sum(-1, keepdims=True))
        u, v = places(world)
        at = u * width - 0.5, np.clip(v * height - 0.5, 0, height - 1)
        x, y = (np.asarray(axis, np.float32) for axis in at)
        light = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        radiances[row] = light.reshape(rays, side, rays, 3).mean((0, 2))
    return radiances


def panorama_places(world: np.ndarray, turned: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Columns and rows, shares of 1, of unit directions (..., 3) on a panorama (H, 2 H, 3), in
    whose middle is -z, x to the right and y up; ``turned`` turns it by radians, to the right."""
    u = 0.5 + (np.arctan2(world[..., 0], -world[..., 2]) - turned) / (2 * math.pi)
    return u % 1.0, np.arccos(np.clip(world[..., 1], -1, 1)) / math.pi


def _read_panorama(path: Path, where: Where) -> np.ndarray:
    """(H, 2 H, 3) float32 linear radiance of a Radiance HDR or EXR file."""
    from lfcore.scene.limits import BRIGHTEST

    def refuse(problem: str, remedy: str) -> SceneError:
        return where.error(f"{str(path)!r} {problem}", remedy)

    kind = path.suffix.lower()
    if kind not in (".hdr", ".exr"):
        raise refuse("is no sky", "Give a Radiance HDR or an EXR file, or a colour such as #80a0c0")
    data = read_bytes(path, LARGEST_FILE, "sky")
    try:
        width, height = picture_size(io.BytesIO(data))
        if width * height > MOST_TEXELS:
            raise refuse(f"has {width} x {height} texels, of {MOST_TEXELS} at most", "Shrink it")
        if width != 2 * height or not height:
            remedy = "Give an equirectangular picture, twice as wide as high"
            raise refuse(f"is no panorama: {width} x {height} texels", remedy)
        panorama = decode(data)
        if panorama.dtype != np.float32:
            raise LfcoreError("it holds no linear light")
    except SceneError:
        raise
    except LfcoreError as error:
        raise refuse(f"cannot be read: {error.problem[:200]}", "Get it again") from None
    if not np.isfinite(panorama).all() or panorama.min() < 0 or panorama.max() > BRIGHTEST:
        fault = f"has values from {panorama.min():g} to {panorama.max():g}"
        raise refuse(fault, f"Give radiance from 0 to {BRIGHTEST:g}")
    return panorama
