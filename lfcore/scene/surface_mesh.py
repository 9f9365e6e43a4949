"""Surface meshes: the triangles of one surface, in world space, before a scene is assembled.

Mesh files and procedural builders both return a list of :class:`SurfaceMesh`, the parts of a
model; ``lfcore.scene.assemble`` turns it into the flat arrays of a
:class:`~lfcore.scene.model.Scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.colour import srgb_decode
from lfcore.scene.appearance import Appearance
from lfcore.scene.arrays import check_appearance, check_texture, columnwise, dot
from lfcore.scene.transforms import chain, translate

Colour = tuple[float, float, float]


def xyz(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> np.ndarray:
    """(..., 3) points of coordinates that broadcast."""
    return np.stack(np.broadcast_arrays(x, y, z), -1)


def triple(values: ArrayLike) -> Colour:
    """Turn three numbers into a tuple of Python's floats."""
    first, second, third = np.asarray(values, np.float64).tolist()
    return first, second, third


def clipped(colour: ArrayLike) -> Colour:
    """Clip a colour to [0, 1]."""
    return triple(np.clip(np.asarray(colour, np.float64), 0, 1))


@dataclass(frozen=True, eq=False)
class Surface(Appearance):
    """A material with its textures as arrays.

    Fields have the meaning of :class:`lfcore.Material`.  Textures are (H, W, 3) uint8, row 0 on
    top: sRGB codes, or linear numbers in ``metal_texture`` and ``normal_texture``.  ``texture``
    may have a fourth channel, alpha.

    Examples
    --------
    >>> clay = lfcore.Surface("clay", diffuse=(0.6, 0.3, 0.2))
    >>> wall = [[[-1, 0, 3], [1, 0, 3], [0, 2, 3]]]
    >>> lfcore.Scene.from_triangles(wall, surface=clay).materials[0].diffuse
    (0.6, 0.3, 0.2)
    """

    texture: np.ndarray | None = None
    metal_texture: np.ndarray | None = None
    normal_texture: np.ndarray | None = None
    emission_texture: np.ndarray | None = None

    def __post_init__(self) -> None:
        check_appearance("", self)
        for name in ("texture", "metal_texture", "normal_texture", "emission_texture"):
            if getattr(self, name) is not None:
                check_texture(name, getattr(self, name))

    @property
    def has_textures(self) -> bool:
        maps = self.metal_texture, self.normal_texture, self.emission_texture
        return any(picture is not None for picture in (self.texture, *maps))


@dataclass(frozen=True, eq=False)
class SurfaceMesh:
    """Triangles that share a surface; float64, metres.

    Attributes
    ----------
    triangles : (T, 3, 3) corner positions.
    normals : (T, 3, 3) shading normals of the corners, need not be unit; None: flat shaded.
    uvs : (T, 3, 2) texture coordinates, v up; None when the surface has no texture.
    colours : (T, 3, 3) linear RGB of the corners; None when white.
    """

    triangles: np.ndarray
    surface: Surface = field(default_factory=Surface)
    normals: np.ndarray | None = None
    uvs: np.ndarray | None = None
    colours: np.ndarray | None = None

    @property
    def count(self) -> int:
        return len(self.triangles)

    def transformed(self, *steps: np.ndarray) -> SurfaceMesh:
        """The part moved by (4, 4) affine matrices, one after the other; normals by their inverse
        transpose."""
        matrix = np.asarray(chain(*steps) if len(steps) > 1 else steps[0], np.float64)
        with np.errstate(invalid="ignore", over="ignore"):  # bad vertices are dropped later
            triangles = self.triangles @ matrix[:3, :3].T + matrix[:3, 3]
        normals = self.normals
        if normals is not None:
            # The cofactor matrix is the inverse transpose up to scale, and exists for any matrix.
            a, b, c = matrix[:3, :3]
            cofactor = np.array([np.cross(b, c), np.cross(c, a), np.cross(a, b)])
            normals = normals @ (cofactor * np.sign(np.linalg.det(matrix[:3, :3]) or 1.0)).T
        return replace(self, triangles=triangles, normals=normals)

    def at(self, x: float, y: float, z: float) -> SurfaceMesh:
        """The part moved by so many metres."""
        return self.transformed(translate(x, y, z))

    def picked(self, index: Any) -> SurfaceMesh:
        """The part with all arrays indexed by ``index``: some triangles, or reordered corners."""
        arrays = {name: getattr(self, name) for name in ("triangles", "normals", "uvs", "colours")}
        return replace(
            self, **{n: array[index] for n, array in arrays.items() if array is not None}
        )


def transform_all(parts: list[SurfaceMesh], *steps: np.ndarray) -> list[SurfaceMesh]:
    return [part.transformed(*steps) for part in parts]


def merge(parts: list[SurfaceMesh]) -> list[SurfaceMesh]:
    """One part for each surface, in order of first appearance; missing arrays are filled in."""
    groups: dict[int, list[SurfaceMesh]] = {}
    for part in parts:
        groups.setdefault(id(part.surface), []).append(part)
    return [join(group) for group in groups.values()]


def join(parts: list[SurfaceMesh]) -> SurfaceMesh:
    """Parts of one surface as one part; missing arrays are filled in."""
    if len(parts) == 1:
        return parts[0]
    triangles = np.concatenate([part.triangles for part in parts])
    return SurfaceMesh(triangles, parts[0].surface, **stacked(parts))


DEFAULTS: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "normals": lambda corners: np.repeat(face_normals(corners)[:, None], 3, 1),
    "uvs": lambda corners: np.zeros((len(corners), 3, 2)),
    "colours": lambda corners: np.ones((len(corners), 3, 3)),
}
"""The default of each attribute of a part, as a function of its triangles."""


def stacked(parts: list[SurfaceMesh]) -> dict[str, np.ndarray | None]:
    """Each attribute over all parts, with :data:`DEFAULTS`; None where every part lacks it."""
    return {
        name: filled(parts, name)
        if any(getattr(part, name) is not None for part in parts)
        else None
        for name in DEFAULTS
    }


def filled(parts: list[SurfaceMesh], name: str) -> np.ndarray:
    """An attribute over all parts, with :data:`DEFAULTS`."""
    arrays = ((getattr(part, name), part.triangles) for part in parts)
    return np.concatenate([DEFAULTS[name](t) if a is None else np.asarray(a, np.float64)
                           for a, t in arrays])  # fmt: skip


def grid_triangles(grid: np.ndarray) -> np.ndarray:
    """(T, 3, N): two triangles for each cell of a grid (R, C, N), row by row."""
    a, b, c, d = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]
    both = np.stack([np.stack([a, b, c], 2), np.stack([a, c, d], 2)], 2)
    return both.reshape(-1, 3, grid.shape[-1])


def area_vectors(triangles: np.ndarray) -> np.ndarray:
    """(T, 3) normals of the counter-clockwise front, as long as twice the area."""
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def face_normals(triangles: np.ndarray) -> np.ndarray:
    """(T, 3) float64 unit geometric normals (counter-clockwise front), zero if degenerate."""
    return normalise(area_vectors(triangles))


def normalise(vectors: np.ndarray) -> np.ndarray:
    """Unit vectors (..., 3); zero stays zero. Scaled first against overflow."""
    vectors = np.asarray(vectors, np.float64)
    largest = columnwise(np.maximum, np.abs(vectors))[..., None]
    scaled = vectors / np.where(largest > 0, largest, 1.0)
    length = np.sqrt(dot(scaled, scaled))[..., None]
    scaled /= np.where(length > 0, length, 1.0)
    return scaled


def parse_colour(value: str | list[float]) -> Colour:
    """Turn a colour of the schema into linear RGB."""
    if isinstance(value, str):
        return hex_colour(value)
    return triple(value)


def hex_colour(code: str) -> Colour:
    """Turn sRGB ``"#rrggbb"`` into linear RGB."""
    encoded = np.array([int(code[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return triple(srgb_decode(encoded))


def shaded(part: SurfaceMesh, shading: str, crease_deg: float) -> SurfaceMesh:
    """The part with its shading normals.

    They are its own if it has any and ``shading`` is ``auto``; none if it is ``flat``; else smooth
    except at edges beyond ``crease_deg``.
    """
    normals = part.normals if shading == "auto" else None
    if normals is None and shading != "flat":
        normals = crease_normals(np.nan_to_num(part.triangles, posinf=0.0, neginf=0.0), crease_deg)
        a, b, c = normals.swapaxes(0, 1)
        if max(np.abs(x - y).max(initial=0.0) for x, y in ((a, b), (b, c), (c, a))) < 1e-6:
            normals = None  # no corner is smooth, so that it stays flat shaded
    surface = replace(part.surface, curved=normals is not None)
    return replace(part, surface=surface, normals=normals)


MAX_VALENCE = 512
"""The most faces at a vertex with smooth normals."""
MIXING = np.uint64(0x9E3779B97F4A7C15)
"""An odd multiplier that hashes coordinates."""
ROUNDING = 1e-6
"""More than rounding changes a cosine."""


def crease_normals(triangles: np.ndarray, crease_deg: float = 40.0) -> np.ndarray:
    """(T, 3, 3) unit normals, the area-weighted mean of the faces that share a corner's position
    and whose normal is within ``crease_deg`` of its own face's; flat where more than
    :data:`MAX_VALENCE` faces meet, as pairs grow with its square."""
    triangles = np.asarray(triangles, np.float64)
    if not len(triangles):
        return np.zeros((0, 3, 3))
    doubled = area_vectors(triangles)
    unit = normalise(doubled)
    vertex, valence = _vertices(triangles.reshape(-1, 3))
    sums = _sums(vertex, np.repeat(doubled, 3, axis=0), len(valence))
    # All faces are within the angle of one another if each is within half of it of their mean.
    corners = vertex.reshape(-1, 3)
    middle, limit = normalise(sums), np.cos(np.radians(crease_deg) / 2) + ROUNDING
    edged = valence > MAX_VALENCE
    for k in range(3):
        edged[corners[dot(middle[corners[:, k]], unit) < limit, k]] = True
    normals = middle[vertex]
    chosen = np.flatnonzero(edged[vertex])
    if len(chosen):
        # Corners of a vertex follow one another; vertices with most corners come first.
        vertex = vertex[chosen]
        order = np.argsort(vertex - valence[vertex] * len(valence), kind="stable")
        chosen, valence = chosen[order], valence[vertex[order]]
        first = np.flatnonzero(np.append(True, np.diff(vertex[order])))
        first = np.repeat(first, valence[first])
        least = np.cos(np.radians(crease_deg))
        normals[chosen] = _split_normals(doubled, unit, chosen // 3, first, valence, least)
    return normals.reshape(-1, 3, 3)


def _vertices(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The vertex number (C,) of each corner at ``points`` (C, 3), and the number of corners per
    vertex."""
    keys = np.zeros(len(points), np.uint64)
    for axis in points.T:
        keys ^= (axis + 0.0).view(np.uint64)  # -0 is 0
        keys ^= keys >> np.uint64(32)
        keys *= MIXING
    order = np.argsort(keys)
    if (apart := _apart(points[order])).sum() > (np.diff(keys[order]) != 0).sum():
        apart = _apart(points[order := np.lexsort(points.T)])  # two vertices have one key
    number = np.cumsum(np.append(False, apart))
    vertex = np.empty_like(number)
    vertex[order] = number
    return vertex, np.bincount(number)


def _apart(points: np.ndarray) -> np.ndarray:
    """Whether points (C, 3) differ from the one before: (C - 1,)."""
    return columnwise(np.logical_or, points[1:] != points[:-1])


def _sums(owner: np.ndarray, vectors: np.ndarray, count: int) -> np.ndarray:
    """(count, 3) sums of vectors (C, 3) over their owners (C,), in order."""
    return np.stack([np.bincount(owner, axis, count) for axis in vectors.T], axis=1)


def _split_normals(
    doubled: np.ndarray,
    unit: np.ndarray,
    face: np.ndarray,
    first: np.ndarray,
    valence: np.ndarray,
    least: float,
) -> np.ndarray:
    """The normals of corners (C,) at vertices whose faces have unlike normals.

    ``doubled`` and ``unit`` (T, 3) are the faces' normals.  A corner has the face ``face``, and
    ``first`` is the first corner of its vertex; ``least`` is the cosine of like normals.
    """
    doubled, unit = doubled[face], unit[face]
    sums = np.zeros_like(unit)
    start = int(np.count_nonzero(valence > MAX_VALENCE))
    for k in range(int(valence[start:].max(initial=0))):
        those = slice(start, int(np.count_nonzero(valence > k)))
        other = first[those] + k
        like = dot(unit[those], unit[other]) >= least
        sums[those] += np.where(like[:, None], doubled[other], 0.0)
    return np.where(columnwise(np.logical_or, sums != 0)[:, None], normalise(sums), unit)
