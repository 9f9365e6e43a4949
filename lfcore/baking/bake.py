"""Bake light: irradiance from the sky, from emitters and, in bounces, from other surfaces.

Rays gather light at points of the surfaces that the camera sees, and at points of the surfaces that
these rays hit; few of the latter suffice, since each is averaged over many rays.  Bounces iterate
over the stored hits.  Then seen points send more rays where two halves of their rays disagree, and
grids are refined where neighbours differ.  In the end the error is measured.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from lfcore.baking.adaptive_refinement import FINEST, Refinement
from lfcore.baking.denoising import denoised
from lfcore.baking.irradiance_cache import IrradianceCache
from lfcore.baking.mesh_colours import Grids, extent, longest_edge
from lfcore.baking.surroundings import FIELD, MOST_SURFACES, Surroundings
from lfcore.baking.verification import measured_error
from lfcore.errors import SceneError
from lfcore.opencl.device import Device
from lfcore.optics.bundles import Bundles
from lfcore.progress import Progress
from lfcore.scene.arrays import dot
from lfcore.scene.baked import BakedLight, BakeOptions
from lfcore.scene.model import Scene
from lfcore.tracing.bvh import Bvh

_RAYS_PER_CELL = 32
"""Sample rays per cell, per side of the picture, that find seen faces."""
_LARGEST_SIDE = 256
"""The most cells along an edge before refinement: 33,000 points per face."""
_LARGEST_CELL = 1 / 24
"""The largest cell, a share of the scene's size."""
_UNSEEN_SIDE = 64
"""The most cells along an edge of an unseen triangle."""
_DIRECT_FINER = 4
"""Cells of direct light per cell, per side: its edges are sharp."""
_DIRECT_CELLS = 128
"""The most cells of direct light over the width of the picture."""
_GLASS = 0.9
"""The least transmission of surfaces that light passes straight, as if they were not there."""
_ROUND_UP = 0.25
"""Added to base-2 logarithms of cells before they are rounded down."""


class SeenFaces(NamedTuple):
    """The faces that the camera sees.

    Attributes
    ----------
    faces : (F,) the faces.
    weights : (F, 3) the mean barycentric weights where each is seen.
    distance : (T,) the least distance of each triangle, metres; infinite if it is not seen.
    """

    faces: np.ndarray
    weights: np.ndarray
    distance: np.ndarray


class GridSides(NamedTuple):
    """The sides of triangles' grids.

    Attributes
    ----------
    sides, direct_sides : (T,) cells along an edge, powers of 2: for irradiance, for direct light.
    cells : (T,) cells for irradiance, in the mean over directions, not rounded; 0 if unseen.
    steps : (T,) the sides of cubes, metres, in which triangles share points if they are smaller
        than the finest cells; else 0.
    """

    sides: np.ndarray
    direct_sides: np.ndarray
    cells: np.ndarray
    steps: np.ndarray


def bake_light(
    scene: Scene,
    bvh: Bvh,
    device: Device,
    options: BakeOptions,
    *,
    progress: Progress | None = None,
) -> BakedLight:
    """Bake the light of a scene's sky, emitters and bounces on all its surfaces.

    Light passes glass straight, and veils by what their opacity leaves.  Mirrors reflect light as
    matt surfaces of their colour, which is closer to the truth than no light.

    ``progress`` is called with (steps done, number of steps).  Raises :class:`SceneError` for a
    material that reflects more light than it receives.
    """
    _check_albedo(scene)
    scene = _without_glass(scene)
    around = Surroundings(scene, bvh, device)
    seen = _seen_faces(scene, around, _RAYS_PER_CELL * options.cells)
    if not len(seen.faces):  # the picture is of the sky alone
        dark = np.tile(np.array([0, 0, 1], np.int32), (scene.triangle_count, 1))
        return BakedLight(dark, np.zeros((3, 3), np.float32), rays=around.rays)
    chosen = _grid_sides(scene, seen.distance, options)
    grids, direct_grids = (
        Grids(scene, around.lens, sides, chosen.steps)
        for sides in (chosen.sides, chosen.direct_sides)
    )
    cache = IrradianceCache(grids, direct_grids, around, options)
    report = progress or (lambda done, of: None)
    cache.find_points(seen.faces, seen.weights)
    report(1, 4)
    cache.bounce()
    report(2, 4)
    cache.converge()
    report(3, 4)
    light = Refinement(cache, denoised(cache), chosen.cells).refine()
    error = math.hypot(measured_error(cache, light), cache.cut)
    report(4, 4)
    return replace(light, error=error, rays=around.rays)


def _without_glass(scene: Scene) -> Scene:
    """The scene with glass that is one hole."""
    glass = [material.transmission >= _GLASS for material in scene.materials]
    if not any(glass):
        return scene
    hole: dict[str, Any] = {"texture": len(scene.textures), "alpha_cutoff": 0.5}
    uvs = scene.uvs if len(scene.uvs) else np.zeros((scene.triangle_count, 3, 2), np.float32)
    return replace(
        scene,
        materials=[
            replace(material, **hole) if is_glass else material
            for material, is_glass in zip(scene.materials, glass, strict=True)
        ],
        textures=[*scene.textures, np.zeros((1, 1, 4), np.uint8)],
        uvs=uvs,
    )


def _check_albedo(scene: Scene) -> None:
    most = scene.colours.max(initial=0) if len(scene.colours) else 1.0
    for number in np.unique(scene.material_ids).tolist():
        material = scene.every_material[number]
        if max(material.diffuse) * most > 1:
            raise SceneError(
                f"reflects {max(material.diffuse) * most:g} of its light", file=scene.name,
                key=f"material {material.name}: diffuse", remedy="Give at most 1",
            )  # fmt: skip


def _seen_faces(scene: Scene, around: Surroundings, count: int) -> SeenFaces:
    """Find what the camera sees in its field and a little beside it; ``count`` rays per side."""
    camera, triangles = scene.camera, scene.triangles
    step, distance = FIELD * camera.field_width / count, np.full(len(triangles), np.inf)
    sums = np.zeros((4, 2 * len(triangles)))
    for number, (x, y) in enumerate(around.lens):
        spacing = 2 if number else 1
        # Rays of all lens points to one place in focus have the same direction: they interleave.
        u, v = step * (number % 2), step * (number // 2 % 2)
        centre = np.array([[x, y, u - x / camera.focus_m, v - y / camera.focus_m]], np.float32)
        steps = spacing * np.array([0, 0, step, step], np.float32)
        rays = Bundles(centre, steps, count // spacing, count // spacing, step)
        triangle, depth = (array[0].ravel() for array in around.tracer.bundle_hits(rays))
        around.rays += len(triangle)
        on = np.flatnonzero(triangle >= 0)
        triangle, depth = triangle[on], depth[on].astype(np.float64)
        np.minimum.at(distance, triangle, depth)
        lens_point = np.array([x, y, 0], np.float32)
        behind = dot(around.unit[triangle], triangles[triangle, 0] - lens_point) > 0
        origins, towards = (vectors.reshape(-1, 3)[on] for vectors in rays.rays())
        places = origins + depth[:, None] * towards
        for _ in range(MOST_SURFACES):
            faces = 2 * triangle + behind
            for total, values in zip(sums, (*places.T, np.ones(len(faces))), strict=True):
                total += np.bincount(faces, values, len(total))
            # What is behind veils and in mirrors is seen, too.
            on = np.flatnonzero(around.veils.is_veil[triangle] | around.mirrors[triangle])
            if not len(on):
                break
            triangle, places, towards, depth = triangle[on], places[on], towards[on], depth[on]
            normal = np.where(around.mirrors[triangle][:, None], around.unit[triangle], 0)
            towards = towards - 2 * dot(normal, towards)[:, None] * normal
            start = places + around.beyond(np.zeros(len(on)), towards)[:, None] * towards
            triangle, far, _ = around.tracer.closest_hit(start, towards)
            around.rays += len(start)
            hit = np.flatnonzero(triangle >= 0)
            triangle, towards, far = triangle[hit], towards[hit], far[hit].astype(np.float64)
            places, depth = start[hit] + far[:, None] * towards, depth[hit] + far
            np.minimum.at(distance, triangle, depth)
            behind = dot(around.unit[triangle], towards) > 0
    faces = np.flatnonzero(sums[3])
    corners = triangles[faces // 2].astype(np.float64)
    weights = _barycentric(corners, (sums[:3, faces] / sums[3, faces]).T)
    return SeenFaces(faces, weights, distance)


def _barycentric(corners: np.ndarray, places: np.ndarray) -> np.ndarray:
    """Return barycentric weights (F, 3) of places (F, 3) on triangles (F, 3, 3)."""
    p, q, r = corners.swapaxes(0, 1)
    normal, offset = np.cross(q - p, r - p), places - p
    parts = [dot(np.cross(offset, r - p), normal), dot(np.cross(q - p, offset), normal)]
    squared = np.maximum(dot(normal, normal), 1e-300)[:, None]
    parts = np.clip(np.stack(parts, -1) / squared, 0, 1)
    weights = np.column_stack([np.maximum(1 - parts.sum(1), 0), parts])
    return weights / weights.sum(1, keepdims=True)


def _grid_sides(scene: Scene, distance: np.ndarray, options: BakeOptions) -> GridSides:
    """Choose cells along an edge of triangles at a ``distance`` (T,)."""
    cells = options.cells
    corners = scene.triangles.astype(np.float64)
    edge, size = longest_edge(corners), extent(scene.triangles)[1]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.sqrt(dot(normal, normal)) / 2
    seen = np.isfinite(distance)
    ends = np.concatenate([corners, corners.mean(1, keepdims=True)], 1)
    nearest = np.sqrt(dot(ends, ends)).min(1)
    width = scene.camera.field_width * np.where(seen, distance, nearest)
    cell = np.clip(width / cells, edge / np.where(seen, np.inf, _UNSEEN_SIDE), size * _LARGEST_CELL)
    finer = min(_DIRECT_FINER, max(1, _DIRECT_CELLS / cells))
    powers = [np.log2(np.maximum(many * edge / cell, 1)) + _ROUND_UP for many in (1, finer)]
    sides, direct_sides = (
        np.minimum(1 << power.astype(np.int64), _LARGEST_SIDE) for power in powers
    )
    finest = cell / np.where(seen, FINEST * options.fineness, 1)
    steps = np.ldexp(1.0, np.frexp(np.maximum(finest, 1e-300))[1] - 1)
    cells_across = np.where(seen, np.sqrt(2 * area) / cell, 0)
    return GridSides(sides, direct_sides, cells_across, np.where(edge < steps, steps, 0))
