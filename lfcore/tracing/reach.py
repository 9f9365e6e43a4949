"""What the rays of a camera can meet at all: triangles, subtrees and lights beyond are left out.

At depth z the rays of a slab fill the square |x|, |y| <= f(z),

    f(z) = R |1 - z delta| + z T

with R the lens radius, T the tangent of the half field and delta the inverse focus distance.  f
is convex, so the points beyond it on one side, x > f(z), are a convex set: a triangle whose corners
all lie there is met by no ray, whichever way it crosses the picture.  So is one that lies behind
the lens.  With shadows, what may lie between a light and what can be seen stays, too.

Nothing is estimated: what is left out cannot change a picture, to the last bit.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from lfcore.optics.camera import Camera
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.model import Scene
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.bvh_wide import LARGEST, UNUSED

SLACK = 1e-4
"""Relative slack of every test: float32 kernels may hit what lies beside their rays by 1e-6."""


def seen(triangles: np.ndarray, camera: Camera) -> np.ndarray:
    """(T,) bool: triangles (T, 3, 3) in camera space that rays of ``camera``'s slab may meet."""
    z = triangles[..., 2].astype(np.float64)
    reach = _half_width(z, camera) + SLACK * _scale(z, camera)
    out = (z <= 0).all(1)
    for axis in (0, 1):
        x = triangles[..., axis].astype(np.float64)
        out |= (x > reach).all(1) | (x < -reach).all(1)
    return np.asarray(~out)


def _half_width(z: np.ndarray, camera: Camera) -> np.ndarray:
    tangent = camera.sensor_width_m / 2 / camera.image_distance_m
    return camera.lens_radius_m * np.abs(1 - z * camera.delta) + z * tangent


def _scale(z: np.ndarray, camera: Camera) -> np.ndarray:
    tangent = camera.sensor_width_m / 2 / camera.image_distance_m
    radius = camera.lens_radius_m
    return radius + np.abs(z) * (tangent + radius * camera.delta)


def reached(scene: Scene, camera: Camera) -> np.ndarray:
    """(T,) bool: triangles that rays of ``camera`` may meet, or their shadow rays."""
    keep = seen(scene.triangles, camera)
    casting = [light for light in scene.lights if light.casts_shadows and any(light.colour)]
    if not casting or not keep.any() or keep.all():
        return keep
    volumes = _volumes(scene.triangles[keep], camera)
    size = float(np.abs(scene.triangles).max())
    rest = np.flatnonzero(~keep)
    for light in casting:
        may = np.ones(len(rest), bool)
        for volume in volumes:
            may[may] = _between(scene.triangles[rest[may]], volume, light, size)
        keep[rest[may]] = True
        rest = rest[~may]
    return keep


def _volumes(triangles: np.ndarray, camera: Camera) -> list[np.ndarray]:
    """(8, 3) float64 corners of convex bodies that hold every point that the camera sees: the box
    of the triangles seen, and the rays' own hull between its ends, whose sides are chords of f."""
    flat = triangles.reshape(-1, 3).astype(np.float64)
    low, high = flat.min(0), flat.max(0)
    low[2] = max(low[2], 0.0)
    box = np.array(list(itertools.product(*zip(low, high, strict=True))))
    ends = np.array([low[2], high[2]])
    wide = _half_width(ends, camera) + SLACK * _scale(ends, camera)
    hull = [(x * w, y * w, z) for w, z in zip(wide, ends, strict=True)
            for x in (-1, 1) for y in (-1, 1)]  # fmt: skip
    return [box, np.array(hull)]


def _between(triangles: np.ndarray, body: np.ndarray, light: Light, size: float) -> np.ndarray:
    """(T,) bool: triangles that may lie between a light and a body, in all coordinate planes."""
    vector = np.asarray(light.vector, np.float64)
    far = vector if light.kind == POINT else body + 4 * size * vector
    points = np.concatenate([body, np.atleast_2d(far)])
    slack = SLACK * np.abs(points).max()
    keep = np.ones(len(triangles), bool)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        corners = triangles[..., [a, b]].astype(np.float64)
        for normal, limit in _outline(points[:, [a, b]]):
            keep &= (corners @ normal).min(1) <= limit + slack
    return keep


def _outline(points: np.ndarray) -> list[tuple[np.ndarray, float]]:
    """Half planes n . x <= limit, n of unit length, that hold (P, 2) points tightly."""
    found = [
        (normal, float((points @ normal).max()))
        for normal in np.array([[1.0, 0], [-1, 0], [0, 1], [0, -1]])
    ]
    for p, q in itertools.permutations(points, 2):
        normal = np.array([q[1] - p[1], p[0] - q[0]])
        length = np.linalg.norm(normal)
        if length == 0:
            continue
        normal /= length
        limit = float((points @ normal).max())
        if limit <= float(p @ normal) + 1e-12 * np.abs(points).max():
            found.append((normal, limit))
    return found


def reaching(scene: Scene, camera: Camera) -> list[Light]:
    """Lights that can add to a picture of ``camera``, in their order.

    Surfaces are lit from the side that they are seen from.  Where they are flat, a light on the
    far side of every triangle that can be seen adds nothing; of interpolated normals nothing is
    claimed.  Black lights add nothing anywhere.
    """
    lights = [light for light in scene.lights if any(light.colour)]
    if len(scene.normals):
        return lights
    p, q, r = scene.triangles[seen(scene.triangles, camera)].astype(np.float64).swapaxes(0, 1)
    normal = np.cross(q - p, r - p)
    radius = camera.lens_radius_m
    viewers = radius * np.array([[-1, -1, 0], [-1, 1, 0], [1, -1, 0], [1, 1, 0.0]])
    sides = np.stack([((viewer - p) * normal).sum(1) for viewer in viewers], axis=1)
    length = np.linalg.norm(normal, axis=1)
    unsure = SLACK * length * (np.abs(p).max(1, initial=0) + radius)
    return [light for light in lights if _lights_any(light, p, normal, sides, unsure, length)]


def _lights_any(
    light: Light,
    p: np.ndarray,
    normal: np.ndarray,
    sides: np.ndarray,
    unsure: np.ndarray,
    length: np.ndarray,
) -> bool:
    vector = np.asarray(light.vector, np.float64)
    if light.kind == POINT:
        side = ((vector - p) * normal).sum(1)
        unsure_light = unsure + SLACK * length * np.abs(vector).max()
    else:
        side, unsure_light = normal @ vector, SLACK * length * np.abs(vector).max()
    front = (side > -unsure_light) & (sides > -unsure[:, None]).any(1)
    back = (side < unsure_light) & (sides < unsure[:, None]).any(1)
    return bool((front | back).any())


def lean(scene: Scene, bvh: Bvh, camera: Camera) -> tuple[Scene, Bvh]:
    """The part of a scene and of its hierarchy that pictures of ``camera`` need.

    Triangles are numbered anew, in their old order, so that of coplanar ones the same wins.
    ``camera`` must be that of the slab to be traced: another focus reaches other triangles.
    A scene that moves while the shutter is open is returned whole.
    """
    if getattr(scene, "motions", ()):
        return scene, bvh
    keep = reached(scene, camera)
    lights = reaching(scene, camera)
    if keep.all():
        return replace(scene, lights=lights), bvh
    columns = {
        name: getattr(scene, name)[keep]
        for name in ("triangles", "normals", "uvs", "colours", "material_ids")
        if len(getattr(scene, name))
    }
    number = np.concatenate([[0], np.cumsum(keep)])
    own = [tuple(number[list(light.own)].tolist()) for light in lights]
    lights = [replace(light, own=range_) for light, range_ in zip(lights, own, strict=True)]
    light = scene.light and replace(scene.light, grids=scene.light.grids[keep])
    return replace(scene, lights=lights, light=light, **columns), prune(bvh, keep)


def prune(bvh: Bvh, keep: np.ndarray) -> Bvh:
    """``bvh`` of the triangles in ``keep`` (T,) alone, renumbered; its boxes stay as they were.

    Leaves and subtrees without any are gone.
    """
    number = np.cumsum(keep) - 1
    stay = (bvh.leaf_ids >= 0) & keep[np.maximum(bvh.leaf_ids, 0)]
    order = np.argsort(~stay, axis=1, kind="stable")
    ids = np.where(stay, number[np.maximum(bvh.leaf_ids, 0)], -1)
    ids = np.take_along_axis(ids, order, axis=1)
    corners = np.where(stay[:, None, :], bvh.leaves, 0)
    corners = np.take_along_axis(corners, order[:, None, :], axis=2)
    leaves = stay.any(1)
    nodes = _alive(bvh.children, leaves)
    nodes[0] = True
    lanes = _alive_lanes(bvh.children, leaves, nodes)[nodes]
    children = _renumbered(bvh.children, leaves, nodes)[nodes]
    children = np.where(lanes, children, UNUSED)
    empty = np.array([LARGEST] * 3 + [-LARGEST] * 3, np.float32)[None, :, None]
    boxes = np.where(lanes[:, None, :], bvh.boxes[nodes], empty)
    order = np.argsort(~lanes, axis=1, kind="stable")
    return Bvh(
        np.ascontiguousarray(np.take_along_axis(boxes, order[:, None, :], axis=2), np.float32),
        np.ascontiguousarray(np.take_along_axis(children, order, axis=1), np.int32),
        np.ascontiguousarray(corners[leaves], np.float32),
        np.ascontiguousarray(ids[leaves], np.int32),
        bvh.leaf_boxes[leaves],
    )


def _alive_lanes(children: np.ndarray, leaves: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """(K, 16) bool: children that hold a triangle still."""
    used = children != UNUSED
    leaf = used & (children < 0)
    node = used & (children >= 0)
    alive = np.zeros(children.shape, bool)
    alive[leaf] = leaves[-1 - children[leaf]]
    alive[node] = nodes[children[node]]
    return alive


def _alive(children: np.ndarray, leaves: np.ndarray) -> np.ndarray:
    """(K,) bool: nodes below which a triangle is left; from the leaves up, a level a turn."""
    nodes = np.zeros(len(children), bool)
    while True:
        found = np.asarray(_alive_lanes(children, leaves, nodes).any(1))
        if (found == nodes).all():
            return nodes
        nodes = found


def _renumbered(children: np.ndarray, leaves: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    new_leaf, new_node = np.cumsum(leaves) - 1, np.cumsum(nodes) - 1
    used = children != UNUSED
    out = np.full(children.shape, UNUSED, np.int64)
    leaf, node = used & (children < 0), used & (children >= 0)
    out[leaf] = -1 - new_leaf[-1 - children[leaf]]
    out[node] = new_node[children[node]]
    return out
