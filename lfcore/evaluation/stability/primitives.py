"""Cases 1 to 4, 7 to 13, 15 and 16: triangles, boxes and scenes that are hard for single rays.

Edges and vertices of closed meshes, needles, grazing rays, axes, flat boxes, coplanar triangles;
then position and size of a scene, by single rays and by blocks.

Error, by default: share of rays that name another triangle than the oracle
outside 16 ulp of an edge or tie (bound 0), or the error of the depth in ulp over the condition
number (bound 16).
"""

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

from lfcore.evaluation.stability import naive, shapes
from lfcore.evaluation.stability.measurement import (
    CHOICE,
    DEPTH,
    NO_ANSWER,
    Bound,
    Measurement,
    choice_and_depth,
    condition_of_depth,
    depth_error,
    leaks,
    measured,
    mismatches,
    sweep,
)
from lfcore.evaluation.stability.shapes import Rays, single
from lfcore.evaluation.stability.tested_tracer import CAMERA, ClosestHit, Found, TracerUnderTest
from lfcore.optics.bundles import macropixels
from lfcore.optics.slab import Slab
from lfcore.oracle.intersect import Hits, closest_hits
from lfcore.readers.load import load_scene

LEAKING = "share of rays that leak"
NO_GAPS = Bound(0, LEAKING, "a closed mesh has no gaps")
AXES = Bound(0, CHOICE, "no direction is special")


@sweep("1", "columns", (12, 50, 100))
def edge_rays(tracer: TracerUnderTest, columns: int) -> Measurement:
    """Points of edges of a sphere seen from within, ever finer."""
    mesh = single(shapes.sphere(max(6, columns // 4), columns, 2.0))
    rng = np.random.default_rng(columns)
    ahead = mesh[(mesh[:, :, 2] > 0.3).all(1)].astype(float)
    chosen = rng.integers(0, len(ahead), tracer.rays)
    side, share = rng.integers(0, 3, tracer.rays), rng.uniform(0, 1, (tracer.rays, 1))
    points = ahead[chosen, side] * share + ahead[chosen, (side + 1) % 3] * (1 - share)
    rays = shapes.rays_at(points, rng.uniform(-0.1, 0.1, (tracer.rays, 2)))
    return _leaks("edge rays", NO_GAPS, tracer.closest, mesh, rays)


@sweep("2", "valence", (4, 8, 64, 200))
def vertex_rays(tracer: TracerUnderTest, valence: int) -> Measurement:
    """The pole of a sphere seen from within, with ever more triangles."""
    mesh = single(shapes.sphere(8, valence, 2.0))
    count = max(50, 2 * tracer.rays // valence)  # the oracle decides each of these by integers
    lens = np.random.default_rng(valence).uniform(-0.1, 0.1, (count, 2))
    rays = shapes.rays_at(np.tile([0.0, 0.0, 2.0], (count, 1)), lens)
    return _leaks("vertex rays", NO_GAPS, tracer.closest, mesh, rays)


@sweep("2", "|c| m", (0.0, 1e2, 1e4, 1e6))
def any_vertex_rays(tracer: TracerUnderTest, distance: float) -> Measurement:
    """All vertices of a closed mesh in all directions, ever farther from the origin."""
    centre = np.array([0.6, 0.64, 0.48]) * distance
    mesh = single(shapes.sphere(16, 32, 2.0, centre))
    corners = np.unique(mesh.reshape(-1, 3), axis=0).astype(float)
    lens = single(centre + np.random.default_rng(3).uniform(-0.2, 0.2, (4, 3)))
    directions = single(np.concatenate([corners - origin for origin in lens]))
    rays = np.repeat(lens, len(corners), axis=0), directions
    return _leaks("vertex rays, any", NO_GAPS, tracer.any_closest, mesh, rays)


def _leaks(
    case: str, bound: Bound, closest: ClosestHit, mesh: np.ndarray, rays: Rays
) -> Measurement:
    hits = closest_hits(mesh, *rays)
    # The mesh is closed around the rays' origins, so the oracle must not leak.
    if (hits.triangle < 0).any():
        raise AssertionError(f"the oracle leaks in {case}")
    return measured(
        case, bound, lambda: leaks(naive.moeller_trumbore(mesh, *rays), hits),
        lambda: leaks(closest(mesh, *rays), hits),
    )  # fmt: skip


@sweep("7", "aspect", 10.0 ** np.arange(0, 9))
def needles(tracer: TracerUnderTest, aspect: float) -> Iterator[Measurement]:
    """Triangles 1 m long and 1 / aspect wide in any direction, rays at points within."""
    rng = np.random.default_rng(7)
    along = rng.normal(0, 1, (300, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    aside = np.cross(along, rng.normal(0, 1, (300, 3)))
    aside /= np.linalg.norm(aside, axis=1, keepdims=True) * aspect
    p = rng.uniform(-1, 1, (300, 3)) + [0, 0, 4]
    mesh = single(np.stack([p, p + along, p + aside], 1))
    rays = shapes.rays_at(mesh.mean(1, dtype=float), (0.01, -0.02))
    return choice_and_depth("needles", tracer.closest, mesh, rays)


@sweep("9", "theta rad", 10.0 ** -np.arange(1, 8))
def grazing(tracer: TracerUnderTest, theta: float) -> Iterator[Measurement]:
    """A plane through the axis at 3 m, tilted against the rays by theta."""
    slope = np.array([0.0, np.tan(theta), 1.0])
    mesh = single(shapes.grid(4, 4, [-1, -theta, 2], [2, 0, 0], 2 * slope))
    u, v = np.random.default_rng(9).uniform(0.1, 0.9, (2, 1000, 1))
    points = np.array([-1, -theta, 2.0]) + 2 * u * [1, 0, 0] + 2 * v * slope
    rays = shapes.rays_at(points, (0.0, 0.0))
    rays[1][:, 1] = 0  # along the axis in y: the plane is met at theta
    rays[0][:, 1] = single(points[:, 1])
    return choice_and_depth("grazing", tracer.closest, mesh, rays)


@sweep("10", "origin on face", (0, 1))
def axes(tracer: TracerUnderTest, on_face: int) -> Measurement:
    """Rays with directions of 0, -0 and +-1 whose origins are on the faces of a cube's box."""
    mesh = single(_cube() + [0, 0, 3])
    slopes = single([-1, -0.0, 0.0, 1]) * np.float32(0.25)
    starts = single([-1, 0, 1] if on_face else [-0.7, 0.1, 0.6])
    x, y, dx, dy = (a.ravel() for a in np.meshgrid(starts, starts, slopes, slopes))
    zeros = np.zeros_like(x)
    rays = np.stack([x, y, zeros], 1), np.stack([dx, dy, zeros + 1], 1)
    hits = closest_hits(mesh, *rays)
    return measured(
        "axis directions",
        AXES,
        lambda: _lost_by_the_box(mesh, rays, hits),
        lambda: leaks(tracer.closest(mesh, *rays), hits),
    )


def _lost_by_the_box(mesh: np.ndarray, rays: Rays, hits: Hits) -> float:
    lo, hi = mesh.min((0, 1)), mesh.max((0, 1))
    return ((hits.triangle >= 0) & ~naive.slab_test(lo, hi, *rays)).mean()


@sweep("10", "|c| m", (0.0, 1e2, 1e4, 1e6))
def any_axes(tracer: TracerUnderTest, distance: float) -> Measurement:
    """All 26 directions of 0, -0 and +-1 from within a cube far off, on its inner planes."""
    steps = single([-1, -0.0, 0.0, 1])
    directions = np.stack(np.meshgrid(steps, steps, steps), -1).reshape(-1, 3)
    directions = directions[directions.any(1)]
    centre = single([distance, -distance, 0.5 * distance])
    mesh = single(_cube() + centre.astype(float))
    starts = single([[0.0, 0, 0], [0.5, 0, -0.5], [0.25, 0.25, 0.5]]) + centre
    rays = np.repeat(starts, len(directions), 0), np.tile(directions, (len(starts), 1))
    return _leaks("axis directions, any", AXES, tracer.any_closest, mesh, rays)


def _cube() -> np.ndarray:
    """The cube of side 2 about the origin, 8 triangles a face."""
    faces = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            corner, across, down = -np.ones(3), np.zeros(3), np.zeros(3)
            corner[axis], across[axis - 1], down[axis - 2] = side, 2.0, 2.0
            faces.append(shapes.grid(2, 2, corner, across, down))
    return np.concatenate(faces)


@sweep("11", "flat dimensions", (0, 1, 2))
def flat_boxes(tracer: TracerUnderTest, flat: int) -> Measurement:
    """Rays at the corners of lone triangles whose boxes have 0, 1 or 2 flat dimensions.

    A triangle is a leaf box; the box test must not lose the ray to its corner.
    """
    rng = np.random.default_rng(11)
    lost, lost_by_naive = [], []
    for _ in range(12):
        triangle = single(rng.uniform(-1, 1, (1, 3, 3)) + [0, 0, 3])
        if flat >= 1:
            triangle[..., 2] = triangle[0, 0, 2]
        if flat == 2:  # as flat as an area allows
            triangle[..., 1] = triangle[0, 0, 1] + single([0, 1e-6, 2e-6])
        corners = np.repeat(triangle[0].astype(float), 100, axis=0)
        rays = shapes.rays_at(corners, rng.uniform(-0.3, 0.3, (300, 2)))
        hits = closest_hits(triangle, *rays)
        lost_by_naive.append(_lost_by_the_box(triangle, rays, hits))
        # Rays at a lone corner are ambiguous within 16 ulp of the free edges.
        missed = tracer.closest(triangle, *rays)[0] < 0
        lost.append((missed & (hits.triangle >= 0) & hits.clear()).mean())
    bound = Bound(0, "share of rays lost", "a box holds its corners")
    return measured("flat boxes", bound, lambda: np.mean(lost_by_naive), lambda: np.max(lost))


def _corner(depth: float) -> np.ndarray:
    """(3, 3) float32: a right angle on the axis, at right angles to it."""
    return single([[0, 0, depth], [1, 0, depth], [0, 1, depth]])


@sweep("15", "separation ulp", (0, 1, 2, 4, 8, 16, 32, 64))
def nearly_coplanar(tracer: TracerUnderTest, ulp: int) -> Measurement:
    """Two triangles some ulp of their depth apart: from 16 ulp on the nearer must win.

    Error: the share of rays with the farther triangle, where the bound of depth, 16 ulp over the
    condition number, decides; below it, the share of rays with neither triangle.
    """
    points = np.random.default_rng(16).uniform(0.05, 0.3, (500, 2))
    rays = shapes.rays_at(shapes.at_depth(points, 2.0), (0.01, 0.0))
    # An ulp is 2^-23 of numbers from 1 to 2.
    mesh = np.stack([_corner(2 + ulp * 2.0**-22), _corner(2.0)])
    hits = closest_hits(mesh, *rays)

    def wrong(found: Found) -> float:
        ids, _ = found
        return ((ids != hits.triangle) & (hits.clear() | (ids < 0))).mean()

    kappa = np.inf if ulp == 0 else 2.0**23 / ulp
    bound = Bound(0, CHOICE, "16 ulp, the bound of a depth, part two of them")
    return measured(
        "nearly coplanar", bound, lambda: wrong(naive.moeller_trumbore(mesh, *rays)),
        lambda: wrong(tracer.closest(mesh, *rays)), condition=kappa,
    )  # fmt: skip


ALL_DIGITS = 2.0**24
"""The error, in units of 2^-24 of a depth, that is as large as the depth itself."""
BLOCK_PIXELS = 24
"""The sampled pixels of a slab that is traced by blocks."""


@sweep("3", "|c| m", (0.0, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7))
def far_from_the_origin(tracer: TracerUnderTest, distance: float) -> Measurement:
    """Scene and camera moved by |c| together; error in units of 2^-24 of the depth.

    lfcore reads a scene file with a mesh and a camera in world coordinates; the naive method rounds
    world coordinates.
    """
    local = shapes.soup(600)
    origins, directions = shapes.random_rays(tracer.rays)
    hits = closest_hits(single(local), origins, directions)
    centre = np.array([0.6, 0.64, 0.48]) * distance
    world = local * [1, -1, -1] + centre  # y is up, and the camera looks along -z

    def by_naive() -> float:
        rays = single(origins + centre), single(directions * [1, -1, -1])
        return _or_lost(naive.moeller_trumbore(single(world), *rays), hits)

    def ours() -> float:
        mesh = _from_file(world, centre)
        return _or_lost(tracer.closest(mesh, origins, directions), hits)

    # World coordinates in float64 are themselves rounded, by 2^-53 of |c|.
    reason = DEPTH.reason + "; world coordinates are float64"
    bound = Bound(DEPTH.error + distance * 2.0**-26, DEPTH.unit, reason)
    kappa = max(1.0, distance) * condition_of_depth(hits)
    return measured("far from the origin", bound, by_naive, ours, condition=kappa)


def _from_file(world: np.ndarray, centre: np.ndarray) -> np.ndarray:
    """(T, 3, 3) float32 of a mesh file in world coordinates, as its scene is read from disk."""
    with tempfile.TemporaryDirectory() as folder:
        lines = ["v {!r} {!r} {!r}".format(*corner) for corner in world.reshape(-1, 3).tolist()]
        lines += [f"f {k} {k + 1} {k + 2}" for k in range(1, 3 * len(world), 3)]
        Path(folder, "mesh.obj").write_text("\n".join(lines) + "\n", encoding="ascii")
        pose = {"position_m": centre.tolist(), "look_at_m": (centre - [0, 0, 1]).tolist()}
        camera = {"focal_length_mm": 50, "sensor_width_mm": 36, "focus_m": 2}
        scene = {"camera": camera | {"pose": pose}, "objects": [{"file": "mesh.obj"}]}
        file = Path(folder, "scene.yaml")
        file.write_text(yaml.safe_dump(scene), encoding="utf-8")
        return load_scene(file, bare=True).triangles


def _or_lost(traced: Found, hits: Hits) -> float:
    """The depth error; all digits are lost when more than 1% of the hits differ."""
    return ALL_DIGITS if mismatches(traced, hits) > 0.01 else depth_error(traced, hits)


@sweep("4", "L / size", 10.0 ** np.arange(0, 8))
def long_rays(tracer: TracerUnderTest, length: float) -> Iterator[Measurement]:
    """An object of 1 m at depth L.  The parameter is depth, so the bound is relative to L."""
    mesh = single(shapes.soup(300, depth=0.0) * 0.2 + [0, 0, length])
    rays = shapes.rays_at(mesh.mean(1, dtype=float), (0.01, -0.01))
    return choice_and_depth("long rays", tracer.closest, mesh, rays)


@sweep("8", "side / distance", 10.0 ** -np.arange(0, 9))
def tiny_triangles(tracer: TracerUnderTest, size: float) -> Iterator[Measurement]:
    """A tilted wall at 1 m in triangles of ever smaller side, rays at their centres.

    Naive: with the customary cut-off at a determinant of 1e-6.
    """
    half, side = -6 * size, 12 * size
    mesh = single(shapes.grid(12, 12, [half, half, 1.0], [side, 0, side], [0, side, 0]))
    rays = shapes.rays_at(mesh.mean(1, dtype=float), (0.01, -0.01))
    return choice_and_depth("tiny triangles", tracer.closest, mesh, rays, epsilon=1e-6)


@sweep("8", "reach / depth", (1.0, 3.0, 10.0, 30.0, 100.0))
def large_triangles(tracer: TracerUnderTest, reach: float) -> Iterator[Measurement]:
    """Triangles with two corners about 1 m away, the third ``reach`` times as far, any direction.

    Beyond ``reach`` = 100 more and more rays are wrong, finally all.
    """
    rng = np.random.default_rng(8)
    mesh = rng.uniform(-0.5, 0.5, (50, 3, 3)) + [0, 0, 1.5]
    away = rng.normal(0, 1, (50, 3))
    mesh[:, 2] += reach * away / np.linalg.norm(away, axis=1, keepdims=True)
    rays = shapes.random_rays(tracer.rays)
    return choice_and_depth("large triangles", tracer.closest, single(mesh), rays)


SCALES = (20, 15, 13, 12, 9, 6, 3, -3, -6, -9, -10, -12, -15, -20, -30, -40)


@sweep("12, 13", "scale", [10.0**exponent for exponent in SCALES])
def scaled_scene(tracer: TracerUnderTest, scale: float) -> Iterator[Measurement]:
    """Scene and lens scaled so that the largest coordinate is ``scale`` metres.

    float32 ranges from 1e-38 to 1e38.  Depth is computed from products of three lengths, whose
    range ends at the third roots.
    """
    origins, directions = shapes.random_rays(tracer.rays)
    base = shapes.soup(600)
    size = np.abs(base).max()
    base, origins = base / size, origins / size
    limit = "coordinates" if scale > 1e12 else "small triangles" if scale < 1e-10 else ""
    rays = single(origins * scale), directions
    return choice_and_depth("scaled scene", tracer.closest, single(base * scale), rays, limit=limit)


@sweep("16", "D / r", (1e1, 1e2, 1e3, 1e4, 1e5))
def far_sphere(tracer: TracerUnderTest, distance: float) -> Measurement:
    """A sphere of 1 m at distance D; naive: the quadratic formula, error over 2^-24 D."""
    centre = (0.0, 0.0, distance)
    mesh = single(shapes.sphere(12, 24, 1.0, centre))
    targets = np.random.default_rng(1).uniform(-0.6, 0.6, (tracer.rays // 5, 2))
    rays = shapes.rays_at(shapes.at_depth(targets, distance), (0.0, 0.0))
    hits = closest_hits(mesh, *rays)

    def by_naive() -> float:
        d = rays[1].astype(float)
        a, b, c = (d**2).sum(1), -2 * d[:, 2] * distance, distance**2 - 1.0
        # -b is positive: the stable root, c over the half sum, is the near one.
        exact = 2 * c / (-b + np.sqrt(b * b - 4 * a * c))
        error = np.abs(naive.sphere(centre, 1.0, *rays) - exact) / distance * 2**24
        return np.nan_to_num(error, nan=NO_ANSWER).max()

    return measured(
        "far sphere",
        DEPTH,
        by_naive,
        lambda: depth_error(tracer.closest(mesh, *rays), hits),
        condition=distance * condition_of_depth(hits),
    )


@sweep("8", "m", (1e-1, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7))
def triangle_sizes(tracer: TracerUnderTest, size: float) -> Iterator[Measurement]:
    """Triangles of ever smaller size at 1 to 3 m, each hit by rays of some pixel; N = 16.

    Blocks of a slab's rays use other arithmetic than single rays: a triangle is set up once for
    16 x 16 rays, relative to their middle ray.  Errors must grow with the triangle's size, not with
    the block's.
    """
    rng, slab = np.random.default_rng(21), Slab(CAMERA, 16, 64)
    pixels = np.unique(rng.integers(0, slab.pixels, (BLOCK_PIXELS, 2)), axis=0)
    rays = shapes.one_by_one(macropixels(slab, pixels).rays())
    aimed = rng.integers(0, len(rays[0]), 600)
    centres = rays[0][aimed] + rng.uniform(1, 3, (600, 1)) * rays[1][aimed]
    mesh = single(centres[:, None] + rng.normal(0, size, (600, 3, 3)))
    return choice_and_depth(
        "blocks: triangle size", lambda *_: tracer.slab_hits(mesh, slab, pixels), mesh, rays
    )
