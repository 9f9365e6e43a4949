"""Bake light: what surfaces get from the sky and, in bounces, from one another.

Rays gather light at points of the surfaces that the camera sees, and at those that these rays hit,
of which few are needed: each is averaged over many rays.  Bounces iterate over the stored hits.
In the picture, more rays follow where two halves of them disagree, more points where neighbours do.

Source: C. Yuksel, J. Keyser and D. House, "Mesh Colors", ACM TOG 29(2), 2010, for the storage;
G. Ward, F. Rubinstein and R. Clear, "A Ray Tracing Solution for Diffuse Interreflection", SIGGRAPH
1988, for irradiance as what is kept.
"""

from dataclasses import replace

import numpy as np

from lfcore.baking.irradiance_cache import Baker
from lfcore.baking.points import Grids, corner_normals, dot, extent, longest_edge
from lfcore.baking.rays import FIELD, Surroundings
from lfcore.baking.refinement import Refinement
from lfcore.errors import SceneError
from lfcore.opencl.device import Device
from lfcore.optics.bundles import Bundles
from lfcore.progress import Progress
from lfcore.scene.baked import NO_SKY, BakedLight, BakeOptions
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.tracer import Tracer

_LARGEST_SIDE, _OF_DIRECT, _DIRECT_CELLS = 256, 4, 128
"""The most cells along an edge; the cells of direct light, whose edges are sharp, per cell, and
over the width of the picture, at most."""


def bake_light(
    scene: Scene,
    bvh: Bvh,
    device: Device,
    options: BakeOptions,
    *,
    progress: Progress | None = None,
) -> BakedLight:
    """The light of a scene's sky and bounces on all its surfaces.

    ``progress`` is called with (steps done, of all).  Raises :class:`SceneError` for a material
    that reflects more light than it gets.
    """
    _check_albedo(scene)
    bare = replace(scene, bake=None, light=None, sky=NO_SKY)
    if not Needs.of(bare).cut_outs:  # else texels say what rays hit
        bare = replace(bare, uvs=bare.uvs[:0])
    around = Surroundings(scene, Tracer(bare, bvh, device))
    seen, spots, distance = _seen_faces(scene, around, 32 * options.cells)
    sides, fine, wanted = _sides(scene, distance, options.cells)
    normals = corner_normals(scene, around.lens)
    grids, lit = (Grids(scene, each, *normals) for each in (sides, fine))
    baker = Baker(grids, lit, around, options)
    report = progress or (lambda done, of: None)
    baker.find(seen, spots)
    report(1, 4)
    baker.bounce()
    report(2, 4)
    baker.converge()
    report(3, 4)
    finished = Refinement(baker, wanted).light()
    report(4, 4)
    return replace(finished, error=baker.error, rays=around.rays)


def _check_albedo(scene: Scene) -> None:
    most = scene.colours.max(initial=0) if len(scene.colours) else 1.0
    for number in np.unique(scene.material_ids).tolist():
        material = scene.materials[number]
        if max(material.diffuse) * most > 1:
            raise SceneError(
                f"reflects {max(material.diffuse) * most:g} of its light", file=scene.name,
                key=f"material {material.name}: diffuse", remedy="Give at most 1",
            )  # fmt: skip


def _seen_faces(scene: Scene, around: Surroundings, count: int) -> tuple[np.ndarray, ...]:
    """Faces that the camera sees, in its field and a little beside it, the mean barycentric weights
    (F, 3) of where it does, and each triangle's least distance; by ``count`` rays per side."""
    camera, corners = scene.camera, scene.triangles.astype(np.float64)
    step, distance = FIELD * camera.field_width / count, np.full(len(corners), np.inf)
    sums = np.zeros((4, 2 * len(corners)))
    for number, (x, y) in enumerate(around.lens):
        apart = 2 if number else 1
        # All lens points see what is in focus in the same direction: their rays interleave.
        u, v = step * (number % 2), step * (number // 2 % 2)
        centre = [[x, y, u - x / camera.focus_m, v - y / camera.focus_m]]
        given = np.array(centre, np.float32), apart * np.array([0, 0, step, step], np.float32)
        rays = Bundles(*given, count // apart, count // apart, step)
        hit, depth = (found[0].ravel() for found in around.tracer.bundle_hits(rays))
        around.rays += len(hit)
        on = np.flatnonzero(hit >= 0)
        hit, depth = hit[on], depth[on].astype(np.float64)
        np.minimum.at(distance, hit, depth)
        behind = dot(around.unit, scene.triangles[:, 0] - np.array([x, y, 0], np.float32)) > 0
        origins, towards = (ways.reshape(-1, 3)[on] for ways in rays.rays())
        places = origins + depth[:, None] * towards
        for total, of_rays in zip(sums, (*places.T, np.ones(len(on))), strict=True):
            total += np.bincount(2 * hit + behind[hit], of_rays, len(total))
    faces = np.flatnonzero(sums[3])
    p, q, r = corners[faces // 2].swapaxes(0, 1)
    across, at = np.cross(q - p, r - p), (sums[:3, faces] / sums[3, faces]).T - p
    parts = np.stack([dot(np.cross(at, r - p), across), dot(np.cross(q - p, at), across)], -1)
    parts = np.clip(parts / np.maximum(dot(across, across), 1e-300)[:, None], 0, 1)
    weights = np.column_stack([np.maximum(1 - parts.sum(1), 0), parts])
    return faces, weights / weights.sum(1, keepdims=True), distance


def _sides(scene: Scene, distance: np.ndarray, cells: int) -> tuple[np.ndarray, ...]:
    """(T,) cells along an edge: powers of 2, as many as the picture needs to begin with and as
    many as direct light needs; and as many as it needs in the mean, of triangles that it shows."""
    corners = scene.triangles.astype(np.float64)
    edge, size = longest_edge(corners), extent(scene.triangles)[1]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.sqrt(dot(across, across)) / 2
    seen = np.isfinite(distance)
    cell = np.where(seen, scene.camera.field_width * np.where(seen, distance, 0) / cells, np.inf)
    cell = np.clip(cell, size / 1024, size / 24)
    finer = min(_OF_DIRECT, max(1, _DIRECT_CELLS / cells))
    wanted = [np.log2(np.maximum(many * edge / cell, 1)) + 0.25 for many in (1, finer)]
    sides, fine = (np.minimum(1 << power.astype(np.int64), _LARGEST_SIDE) for power in wanted)
    return sides, fine, np.where(seen, np.sqrt(2 * area) / cell, 0)
