"""The tracer of one scene: rays to arrays of hits, or of light and depth."""

from collections.abc import Sequence
from functools import reduce
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.opencl.device import Device, open_device, page_aligned
from lfcore.optics import bundles as rays
from lfcore.optics.bundles import Bundles
from lfcore.optics.slab import Slab
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.tracing.arrays import check_sets, fill_arrays
from lfcore.tracing.bvh import Bvh
from lfcore.tracing.device_scene import DeviceScene
from lfcore.tracing.given_rays import GivenRays, HitSurfaces, RayHits
from lfcore.tracing.job import PacketJob
from lfcore.tracing.plan import Plan, probe
from lfcore.tracing.specular import SeenParts, follow, specular_triangles

SMALLEST_SCENE = 1e-12
"""The least coordinate of a scene, metres: products of three smaller ones underflow float32, and
rays would miss silently."""


class Tracer:
    """Traces one scene on one device.

    Parameters
    ----------
    scene, bvh : a scene, and its hierarchy.
    device : an open device; default :func:`lfcore.opencl.device.open_device`.
    needs : features to compile in; default the scene's.
    mipmaps : whether textures are filtered over a pixel's footprint, or read at full size.
    spanning : whether blocks span neighbouring elements; default if that is faster.
    single_rays : whether rays are followed one by one; default if that is faster.
    before : a tracer of the scene at another instant, whose textures and baked light are used.

    Raises
    ------
    SceneError
        for a scene within SMALLEST_SCENE of the lens.
    """

    def __init__(
        self,
        scene: Scene,
        bvh: Bvh,
        device: Device | None = None,
        needs: Needs | None = None,
        *,
        mipmaps: bool = True,
        spanning: bool | None = None,
        single_rays: bool | None = None,
        before: "Tracer | None" = None,
    ):
        if 0 < np.abs(scene.triangles).max(initial=0) < SMALLEST_SCENE:
            raise SceneError(
                f"all coordinates are below {SMALLEST_SCENE:g} m, too small for float32",
                remedy="Give the scene in larger units",
            )
        if scene.bake and scene.light is None:
            raise SceneError(
                "the light of its sky and bounces is not baked", file=scene.name,
                remedy="Call lfcore.bake first",
            )  # fmt: skip
        self.scene, self.device = scene, device or open_device()
        self.needs = needs or Needs.of(scene)
        self._on_device: DeviceScene = DeviceScene(
            scene, bvh, self.device, self.needs, mipmaps=mipmaps,
            before=before._on_device if before else None,
        )  # fmt: skip
        # With one more for misses, whose number is -1.
        count = len(scene.triangles)
        goes_on = specular_triangles(scene) if self.needs.specular else np.zeros(count, bool)
        self._goes_on = np.append(goes_on, False)
        self.plan = Plan(bvh.leaf_boxes, spanning=spanning, single_rays=single_rays)

    def __repr__(self) -> str:
        return f"<Tracer of {self.scene!r} on {self.device!r}>"

    def slab_hits(self, slab: Slab, pixels: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Closest triangle and depth of every ray through ``pixels``.

        Parameters
        ----------
        slab : the rays.
        pixels : (P, 2) integer, columns u and rows v.

        Returns
        -------
        triangle : (P, N, N) int32, indexed [pixel, j, i]; -1 for a miss.
        depth : (P, N, N) float32, metres along the axis; infinity for a miss.
        """
        pixels = np.asarray(pixels).reshape(-1, 2)
        places, number = np.unique(pixels, axis=0, return_inverse=True)
        found = _hits(self.job("HITS", probe(slab)), rays.macropixels(slab, places), places)
        return found[0][number.ravel()], found[1][number.ravel()]

    def bundle_hits(
        self, bundles: Bundles, coordinates: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """As :meth:`slab_hits` for any bundles: (E, rows, columns) triangle and depth.

        ``coordinates`` (E, 2) are the elements' distinct places on their lattice, so that blocks
        can span neighbours.
        """
        job = self.job("HITS", bundles, grouped=coordinates is not None)
        return _hits(job, bundles, coordinates)

    def job(self, sink: str, bundles: Bundles, *, grouped: bool = True) -> PacketJob:
        """A job for such bundles; ``grouped``: whether elements have places."""
        check_sets([bundles])
        return PacketJob(self._on_device, self.plan.shape(bundles, grouped=grouped), sink)

    def bundle_radiance(
        self, bundles: Bundles, coordinates: np.ndarray | None = None
    ) -> np.ndarray:
        """Linear RGB radiance of every ray, not clamped: (E, rows, columns, 3) float32.

        ``coordinates`` as for :meth:`bundle_hits`.
        """
        radiance = page_aligned((len(bundles.elements), bundles.traced_rows, bundles.columns, 3))
        job = self.job("IMAGE", bundles, grouped=coordinates is not None)
        self.fill_radiance(job, bundles, coordinates, radiance)
        return radiance

    def fill_radiance(
        self,
        job: PacketJob,
        bundles: Bundles,
        coordinates: np.ndarray | None,
        radiance: np.ndarray,
        depth: np.ndarray | None = None,
    ) -> None:
        """Fill what :meth:`bundle_radiance` or, with ``depth``, :meth:`radiance_and_depth` returns,
        by a job for the sink IMAGE."""
        triangle = page_aligned(radiance.shape[:-1], np.int32) if self.needs.specular else None
        outputs = {"radiance": radiance, "depth": depth, "triangle": triangle}
        arrays = {name: array for name, array in outputs.items() if array is not None}
        left_out: dict[str, Any] = {name: None for name, array in outputs.items() if array is None}
        fill_arrays(job, [bundles], coordinates, arrays, **left_out)
        if triangle is not None and (paths := self._paths(bundles, triangle)):
            chosen, seen = paths
            radiance.reshape(-1, 3)[chosen] += seen.own + seen.specular

    def _paths(self, bundles: Bundles, triangle: np.ndarray) -> tuple[np.ndarray, SeenParts] | None:
        """The numbers of the rays that hit specular surfaces, and what these see without the own
        light of the surfaces that they hit."""
        chosen = np.flatnonzero(self._goes_on[triangle.ravel()])
        if not len(chosen):
            return None
        rays, known = bundles.some_rays(chosen), triangle.ravel()[chosen]
        return chosen, follow(
            self._on_device, *rays, bundles.pixel_pitch, known, pitches=bundles.pitches
        )

    def radiance_and_depth(self, bundles: Bundles) -> tuple[np.ndarray, np.ndarray]:
        """Radiance and depth of every ray in one pass: see :meth:`bundle_radiance`.

        (E, rows, columns, 3) and (E, rows, columns) float32, for the traced rows; depth is infinity
        for a miss.
        """
        shape = len(bundles.elements), bundles.traced_rows, bundles.columns
        radiance, depth = page_aligned((*shape, 3)), page_aligned(shape)
        job = self.job("IMAGE", bundles, grouped=False)
        self.fill_radiance(job, bundles, None, radiance, depth)
        return radiance, depth

    def parts(
        self, bundles: Bundles, *, placed: bool = False
    ) -> list[tuple[np.ndarray, np.ndarray]]:
        """Radiance and depth of every ray, as :meth:`radiance_and_depth`, in one part or two.

        The second part is what mirrors, glass, coats and veils show, and the depth at which it
        appears; there is none where the rays meet no such surface.  Its radiance and depth are 0
        for rays to which they show nothing.  The first part is then without it.  With ``placed``
        specular light takes the place of own light where this is at most BLACK, and there is no
        second part if all does.
        """
        if not self.needs.specular:
            return [self.radiance_and_depth(bundles)]
        shape = len(bundles.elements), bundles.traced_rows, bundles.columns
        light, depth = page_aligned((*shape, 3)), page_aligned(shape)
        triangle = page_aligned(shape, np.int32)
        arrays = {"radiance": light, "depth": depth, "triangle": triangle}
        fill_arrays(self.job("IMAGE", bundles, grouped=False), [bundles], None, arrays)
        if not (paths := self._paths(bundles, triangle)):
            return [(light, depth)]
        chosen, seen = paths
        seen = seen._replace(own=seen.own + light.reshape(-1, 3)[chosen])
        seen = seen.placed() if placed else seen
        light.reshape(-1, 3)[chosen], depth.reshape(-1)[chosen] = seen.own, seen.own_depth
        there = np.flatnonzero(seen.specular_depth)
        if placed and not len(there):
            return [(light, depth)]
        shown, apparent = np.zeros_like(light), np.zeros_like(depth)
        shown.reshape(-1, 3)[chosen[there]] = seen.specular[there]
        apparent.reshape(-1)[chosen[there]] = seen.specular_depth[there]
        return [(light, depth), (shown, apparent)]

    def shows_others(self, triangle: np.ndarray) -> np.ndarray:
        """Whether triangles of these numbers reflect or let pass what is around them: mirrors,
        glass, coats and veils; bool, False for -1."""
        return self._goes_on[triangle]

    def mosaic_radiance(
        self,
        sets: Sequence[Bundles],
        across: int,
    ) -> np.ndarray:
        """The sum of the radiance of all ``sets`` as a mosaic of the elements' pictures.

        Parameters
        ----------
        sets : bundles with equal numbers of elements and equal inner grids.
        across : elements in a row, a divisor of their number; element e is at row e // across,
            column e % across.

        Returns
        -------
        (E / across rows, across columns, 3) float32, linear RGB, not clamped.
        """
        check_sets(sets, across)
        first, down = sets[0], len(sets[0].elements) // across
        shape = down * first.traced_rows, across * first.columns, 3
        if self.needs.specular:
            sums = reduce(np.add, map(self.bundle_radiance, sets))
            grid = sums.reshape(down, across, first.traced_rows, first.columns, 3)
            return np.ascontiguousarray(grid.swapaxes(1, 2)).reshape(shape)
        image = page_aligned(shape)
        job = self.job("IMAGE", first, grouped=False)
        nothing = {"depth": None, "triangle": None}
        fill_arrays(job, sets, None, {"radiance": image}, across=across, **nothing)
        return image

    def bundle_surfaces(
        self, bundles: Bundles, coordinates: np.ndarray | None = None
    ) -> HitSurfaces:
        """The surfaces that the rays of bundles hit, (E, rows, columns, 3) each.

        ``coordinates`` as for :meth:`bundle_hits`.
        """
        shape = len(bundles.elements), bundles.traced_rows, bundles.columns, 3
        values = HitSurfaces(*(page_aligned(shape) for _ in HitSurfaces._fields))
        arrays = dict(zip(("radiance", "albedo", "normal"), values, strict=True))
        job = self.job("SURFACE", bundles, grouped=coordinates is not None)
        fill_arrays(job, [bundles], coordinates, arrays)
        return values

    def closest_hit(self, origins: np.ndarray, directions: np.ndarray) -> RayHits:
        """The first hits of given rays.

        Parameters
        ----------
        origins, directions : (R, 3) float32; directions need not be of unit length.  Rays that are
            not finite, or have no direction, miss.
        """
        return GivenRays(self._on_device, origins, directions).hits()

    def hit_radiance(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        hits: RayHits,
        *,
        filtered: float | np.ndarray = 0.0,
    ) -> np.ndarray:
        """Linear RGB radiance of given rays, not clamped: (R, 3) float32.

        Parameters
        ----------
        origins, directions : as for :meth:`closest_hit`.
        hits : what the rays hit.
        filtered : textures are filtered over this tangent, or over widths (R,) across the rays,
            metres.

        Raises
        ------
        OpticsError
            for hits of other rays or of another scene.
        """
        return GivenRays(self._on_device, origins, directions).radiance(hits, filtered)

    def hit_surfaces(
        self,
        origins: np.ndarray,
        directions: np.ndarray,
        hits: RayHits,
        *,
        filtered: float | np.ndarray = 0.0,
        normals: bool = True,
    ) -> HitSurfaces:
        """The surfaces that given rays hit, without ``normals`` if these are not wanted.

        Other parameters and errors as for :meth:`hit_radiance`.
        """
        rays = GivenRays(self._on_device, origins, directions)
        return rays.surfaces(hits, filtered, normals=normals)


def _hits(
    job: PacketJob, bundles: Bundles, coordinates: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray]:
    shape = len(bundles.elements), bundles.traced_rows, bundles.columns
    triangle, depth = page_aligned(shape, np.int32), page_aligned(shape)
    fill_arrays(job, [bundles], coordinates, {"triangle": triangle, "depth": depth})
    return triangle, depth
