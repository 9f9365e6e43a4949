"""Turn parts in world space into the flat float32 arrays of a scene."""

import hashlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lfcore.reading import Where
from lfcore.scene.appearance import RANGES, Material
from lfcore.scene.arrays import columnwise, dot
from lfcore.scene.surface_mesh import (
    DEFAULTS,
    Surface,
    SurfaceMesh,
    area_vectors,
    face_normals,
    filled,
    normalise,
    triple,
)

LARGEST_COORDINATE = 1e12
"""The largest coordinate, metres.  Depth is a quotient of products of three lengths, n . P with n
the cross product of two edges; beyond, such a product exceeds float32's 3e38."""
SMALLEST_VOLUME = 1e-36
"""The least twice area times farthest coordinate, cubic metres; below, n . P leaves float32's
normal range, which ends at 1e-38."""
FLAT = 1e-13
"""The least twice area over the longest edge squared: rotation in float64 moves collinear corners
by about its rounding."""
AT_A_TIME = 1 << 18
"""The triangles that are assembled at a time: their float64 arrays stay in tens of MB."""
TEXTURES = {
    "texture": "sRGB",
    "metal_texture": "data",
    "normal_texture": "data",
    "emission_texture": "sRGB",
}
"""The textures of a surface, and whether their codes are sRGB or linear data."""
COLOURS = "diffuse", "specular", "emission", "attenuation_colour"
NUMBERS = "shininess", "alpha_cutoff", "normal_scale", *RANGES
FLAGS = "curved", "alpha_blend", "thin_walled"


@dataclass
class Geometry:
    """The geometric half of a :class:`~lfcore.scene.model.Scene`; same shapes and dtypes."""

    triangles: np.ndarray
    normals: np.ndarray
    uvs: np.ndarray
    colours: np.ndarray
    material_ids: np.ndarray
    materials: list[Material]
    textures: list[np.ndarray]
    dropped: dict[str, int] = field(default_factory=dict)
    kept: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    """Which of the parts' triangles are there."""

    @property
    def arrays(self) -> dict[str, Any]:
        """The fields of a scene."""
        return {name: value for name, value in vars(self).items() if name != "kept"}

    def refuse_none(self, where: Where, remedy: str | None = None) -> None:
        """Raise :class:`SceneError` where no triangle is left."""
        if not len(self.triangles):
            reasons = ", ".join(self.dropped) or "there is none"
            problem = f"the scene is empty: every triangle was dropped ({reasons})"
            raise where.error(problem, remedy)


def assemble(parts: list[SurfaceMesh], to_camera: np.ndarray) -> Geometry:
    """Move parts from world into camera space in float64, drop untraceable triangles, round once.

    ``dropped`` counts the triangles left out by reason; arrays that no part uses are empty.
    """
    parts = [part for part in parts if part.count]
    materials, textures, ids = _materials(parts)
    columns = {name: any(getattr(part, name) is not None for part in parts) for name in DEFAULTS}
    # A texture that nobody samples costs a texture coordinate per corner: leave both out.
    columns["uvs"] &= bool(textures)
    widths, dropped = {"triangles": 3, "normals": 3, "uvs": 2, "colours": 3}, Counter[str]()
    rounded = {name: [np.zeros((0, 3, width), np.float32)] for name, width in widths.items()}
    kept = [np.zeros(0, bool)]  # of each batch
    for batch in _batches(parts):
        moved = [part.transformed(to_camera) for part in batch]
        arrays = {"triangles": np.concatenate([part.triangles for part in moved])}
        keep, reasons = sound(arrays["triangles"])
        arrays |= {name: filled(moved, name) for name, used in columns.items() if used}
        if columns["normals"]:
            arrays["normals"] = sound_normals(arrays["normals"], arrays["triangles"])
        for name, values in arrays.items():
            rounded[name].append(values[keep].astype(np.float32))
        kept.append(keep)
        dropped.update(reasons)
    counts = np.array([part.count for part in parts], np.int64)
    keep = np.concatenate(kept)
    return Geometry(
        **{name: np.concatenate(values) for name, values in rounded.items()},
        material_ids=np.repeat(np.array(ids, np.int32), counts)[keep],
        materials=materials, textures=textures, dropped=dict(dropped), kept=keep,
    )  # fmt: skip


def _batches(parts: list[SurfaceMesh]) -> Iterator[list[SurfaceMesh]]:
    """The parts in order, in lists of about AT_A_TIME triangles; larger parts are cut."""
    batch, count = list[SurfaceMesh](), 0
    for part in parts:
        for first in range(0, part.count, AT_A_TIME):
            batch.append(part.picked(slice(first, first + AT_A_TIME)))
            count += batch[-1].count
            if count >= AT_A_TIME:
                yield batch
                batch, count = [], 0
    if batch:
        yield batch


def sound(triangles: np.ndarray) -> tuple[np.ndarray, dict[str, int]]:
    """Which of (T, 3, 3) triangles can be traced: (T,) bool, and counts of the others by reason."""
    largest = columnwise(np.maximum, np.abs(triangles).reshape(-1, 9))
    finite, bounded = np.isfinite(largest), largest <= LARGEST_COORDINATE
    if not bounded.all():
        triangles = np.where(bounded[:, None, None], triangles, 0)
    rounded = triangles.astype(np.float32).astype(np.float64)
    area = _twice_area(rounded)
    thin = bounded & ~((_twice_area(triangles) > FLAT * _longest_squared(triangles)) & (area > 0))
    volume = area * columnwise(np.maximum, np.abs(rounded).reshape(-1, 9))
    small = bounded & ~thin & (volume < SMALLEST_VOLUME)
    counts = {
        "not finite": int((~finite).sum()),
        "out of range": int((finite & ~bounded).sum()),
        "zero area": int(thin.sum()),
        "too small": int(small.sum()),
    }
    keep = bounded & ~thin & ~small
    return keep, {reason: number for reason, number in counts.items() if number}


def _longest_squared(triangles: np.ndarray) -> np.ndarray:
    """The square (T,) of the longest edge."""
    a, b, c = triangles.swapaxes(0, 1)
    return np.maximum.reduce([dot(p - q, p - q) for p, q in ((a, b), (b, c), (c, a))])


def _twice_area(triangles: np.ndarray) -> np.ndarray:
    vectors = area_vectors(triangles)
    return np.sqrt(dot(vectors, vectors))


def sound_normals(normals: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Unit normals; corners whose normal is zero or not finite take the geometric normal."""
    finite = columnwise(np.logical_and, np.isfinite(normals))[..., None]
    unit = normalise(normals if finite.all() else np.where(finite, normals, 0.0))
    bad = columnwise(np.logical_and, unit == 0)
    if bad.any():
        rows = bad.any(1)
        with np.errstate(all="ignore"):
            flat = face_normals(np.nan_to_num(triangles[rows]))
        unit[rows] = np.where(bad[rows][..., None], flat[:, None], unit[rows])
    return unit


def _materials(parts: list[SurfaceMesh]) -> tuple[list[Material], list[np.ndarray], list[int]]:
    """Distinct materials and textures, and the material index of each part."""
    textures: list[np.ndarray] = []
    texture_index: dict[bytes, int] = {}
    material_index: dict[Material, int] = {}
    ids = []
    for part in parts:
        surface = part.surface
        numbers = dict.fromkeys(TEXTURES, -1)
        for name in TEXTURES:
            picture = getattr(surface, name)
            if picture is None or part.uvs is None:
                continue
            texture = np.ascontiguousarray(picture, np.uint8)
            kind = f"{TEXTURES[name]} {texture.shape}".encode()
            digest = hashlib.blake2b(kind + texture.tobytes(), digest_size=16).digest()
            if digest not in texture_index:
                texture_index[digest] = len(textures)
                textures.append(texture)
            numbers[name] = texture_index[digest]
        material = _material(surface, numbers)
        ids.append(material_index.setdefault(material, len(material_index)))
    return list(material_index), textures, ids


def _material(surface: Surface, textures: Any) -> Material:
    colours: Any = {name: triple(getattr(surface, name)) for name in COLOURS}
    numbers: Any = {name: float(getattr(surface, name)) for name in NUMBERS}
    flags: Any = {name: bool(getattr(surface, name)) for name in FLAGS}
    return Material(surface.name, **colours, **numbers, **flags, **textures)
