"""Gathering on the device: rays from points, and the light that they bring.

Rays and hits stay on the device: copies to the host took two thirds of a bake's time.
"""

from typing import Any

import numpy as np

from lfcore.baking.emitters import Emitters
from lfcore.baking.importance_guide import SIDE, ImportanceGuide
from lfcore.baking.mesh_colours import Grids, Points, lattice, lattice_weights
from lfcore.baking.sampling import R2, TURNS, circle, shifts
from lfcore.baking.surroundings import ALONG_SURFACE
from lfcore.opencl.device import cl, page_aligned
from lfcore.opencl.interface import FLOAT, INT, SHARED, UINT, Interface, given, read, record, write
from lfcore.opencl.kernel import Kernel
from lfcore.opencl.programs import Program
from lfcore.tracing.given_rays import records_of
from lfcore.tracing.layouts import RAY_HIT

NUMBERS = np.dtype([("points", INT), ("count", INT), ("first", UINT), ("emitter_share", FLOAT)])
"""``count`` rays per point, from number ``first`` of its sequence; see :class:`Emitters`."""
POINT = np.dtype([("place", FLOAT, 3), ("normal", FLOAT, 3), ("flat", FLOAT, 3), ("lift", FLOAT),
                  ("shift", UINT, 2), ("table", INT)])  # fmt: skip
"""A point.  Its rays start ``lift`` metres off the triangle; ``shift`` is its sequence's."""
SENT = np.dtype([("weight", FLOAT), ("cosine", FLOAT)])
"""A ray: the density of cosine-weighted rays over its own, and its cosine to the normal."""
FACE = np.dtype([("first", INT), ("side", INT), ("density", FLOAT), ("emits", np.uint16),
                 ("is_seen", np.uint16)])  # fmt: skip
"""A face: the first index and the cells along an edge of its grid; emitter samples per area."""
KEPT_HIT = np.dtype([("face", INT), ("weights", np.uint16, 3), ("albedo", np.uint16, 3),
                     ("emission", np.uint16), ("unused", np.uint16)])  # fmt: skip
"""A hit that is kept for :meth:`Gatherer.reflect`; face -1 is a miss."""
POINT_SUM = np.dtype([("halves", FLOAT, 6), ("is_open", INT)])
"""A point's light, of both halves of its rays."""
_LIGHT = read(faces="Face", index="int", light="float")
INTERFACE = SHARED | Interface(
    constants={"GUIDE_SIDE": SIDE, "TURNS": TURNS, "ALONG_SURFACE": float(ALONG_SURFACE)},
    records={"Numbers": NUMBERS, "Point": POINT, "Sent": SENT, "Face": FACE, "KeptHit": KEPT_HIT,
             "PointSum": POINT_SUM, "RayHit": RAY_HIT},
    kernels={
        "aim": given(numbers="Numbers")
        | read(points="Point", rows="float", columns="float", cell_weights="float", circle="float2")
        | write(origins="float", directions="float", sent="Sent"),
        "sum_light": given(numbers="Numbers")
        | read(sent="Sent", directions="float", flats="float")
        | read(hits="RayHit", albedo="float", emission="float")
        | _LIGHT
        | write(sums="PointSum", kept="KeptHit"),
        "reflect": given(numbers="Numbers")
        | read(kept="KeptHit")
        | _LIGHT
        | write(sums="PointSum", ray_light="float"),
    },
)  # fmt: skip
"""What the kernels share with the host."""
MACROS = {"R2_A": f"{R2[0]}u", "R2_B": f"{R2[1]}u"}
PROGRAM: Program = ["baking/kernels/gather.cl"], MACROS, INTERFACE


class Gatherer:
    """Sends rays from points; ``seen`` (2 T,) is the mask of faces that points in the open see."""

    def __init__(self, emitters: Emitters, seen: np.ndarray):
        self.emitters, self.around = emitters, emitters.around
        self.device = self.around.tracer.device
        self._faces = np.zeros(len(seen), FACE)
        self._faces["is_seen"], self._faces["density"] = seen, emitters.density
        self._faces["emits"] = np.repeat(self.around.emits, 2)
        files, defines, interface = PROGRAM
        self._aim, self._sum_light, self._reflect = (
            Kernel(self.device, files, name, defines, interface)
            for name in ("aim", "sum_light", "reflect")
        )
        self._circle = self._copy(circle().T)
        self._flats = self._copy(self.around.unit)
        self._light = {"faces": self._copy(self._faces), "index": None, "light": None}
        self._tables = [self._copy(np.zeros(1))] * 3

    def _copy(self, array: np.ndarray) -> cl.Buffer:
        """Return a copy on the device; float64 becomes float32."""
        is_wide = array.dtype == np.float64
        return self.device.buffer(np.ascontiguousarray(array, np.float32 if is_wide else None))

    def set_grids(self, grids: Grids, direct_grids: Grids) -> None:
        """Set where the light of faces is: at points of ``direct_grids``, which are numbered after
        those of ``grids``, where a face has such a grid."""
        count, length = len(grids.points), len(grids.index)
        self._near = np.arange(count + len(direct_grids.points))
        refined = np.flatnonzero(direct_grids.first >= 0)
        for side in np.unique(direct_grids.sides[refined // 2]).tolist():
            faces, number = refined[direct_grids.sides[refined // 2] == side], len(lattice(side))
            weights = np.tile(lattice_weights(side), (len(faces), 1))
            at = direct_grids.first[faces, None] + np.arange(number)
            index = direct_grids.index[at].ravel()
            self._near[count + index] = grids.nearest(np.repeat(faces, number), weights)
        alone = length + len(direct_grids.index) + np.arange(len(grids.first))
        coarse = np.where(grids.first >= 0, grids.first, alone)
        side = np.where(grids.first >= 0, np.repeat(grids.sides, 2), 0)
        has_direct = direct_grids.first >= 0
        self._faces["first"] = np.where(has_direct, length + direct_grids.first, coarse)
        self._faces["side"] = np.where(has_direct, np.repeat(direct_grids.sides, 2), side)
        index = np.concatenate([grids.index, count + direct_grids.index, grids.substitute])
        self._light["faces"] = self._copy(self._faces)
        self._light["index"] = self._copy(index.astype(np.int32))

    def set_light(self, irradiance: np.ndarray, direct: np.ndarray) -> None:
        """Set the light that surfaces reflect: ``irradiance`` (P, 3) at points of the grids, and
        ``direct`` (P + D, 3), of the scene's lights, also at points of the direct grids."""
        self._light["light"] = None  # frees memory first
        total = irradiance.astype(np.float32)[self._near]
        self._light["light"] = self._copy(np.add(total, direct, out=total))

    def set_guide(self, guide: ImportanceGuide) -> None:
        """Guide rays from now on."""
        self._tables = [self._copy(array) for array in guide.limits]

    def send(
        self, points: Points, seeds: np.ndarray, first: int, count: int, tables: np.ndarray | int
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Send ``count`` rays per point, from number ``first`` of its sequence on.

        Parameters
        ----------
        seeds : (P,) the seeds of the points' sequences.
        tables : (P,) the points' tables of the guide; -1 for unguided rays.

        Returns
        -------
        sums : (2, P, 3) the light of both halves of the rays.
        is_open : (P,) whether a ray left the scene or hit a seen face; false inside objects.
        kept : (R,) KEPT_HIT, for :meth:`reflect`.
        """
        number, rays = len(points), len(points) * count
        records = np.zeros(number, POINT)
        records["place"], records["normal"] = points.places, points.normals
        records["flat"], records["lift"] = points.flat, self.around.lifts(points)
        records["shift"], records["table"] = shifts(seeds), tables
        aimed = {
            "origins": page_aligned((rays, 3)), "directions": page_aligned((rays, 3)),
            "sent": page_aligned((rays,), SENT),
        }  # fmt: skip
        names = "rows", "columns", "cell_weights"
        tables_on_device = dict(zip(names, self._tables, strict=True))
        numbers = record(NUMBERS, points=number, count=count, first=first,
                         emitter_share=self.emitters.share)  # fmt: skip
        self._launch(self._aim, numbers, aimed, points=self._copy(records), circle=self._circle,
                     **tables_on_device)  # fmt: skip
        hits, surfaces = self.around.surfaces(aimed["origins"], aimed["directions"])
        seen = {
            "sent": aimed["sent"], "directions": aimed["directions"], "hits": records_of(hits),
            "albedo": surfaces.albedo, "emission": surfaces.emission,
        }  # fmt: skip
        results = {
            "sums": page_aligned((number,), POINT_SUM),
            "kept": page_aligned((rays,), KEPT_HIT),
        }
        shown = {name: self.device.shared(array) for name, array in seen.items()}
        self._launch(self._sum_light, numbers, results, flats=self._flats, **shown, **self._light)
        sums = _halves(results["sums"]) + self.emitters.gather(points, seeds, first, count)
        return sums, results["sums"]["is_open"] > 0, results["kept"]

    def reflect(self, number: int, count: int, kept: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the light that surfaces reflect along the rays of ``number`` points whose hits
        :meth:`send` ``kept``: sums (2, P, 3) of both halves; and all light per ray (R,)."""
        results = {
            "sums": page_aligned((number,), POINT_SUM), "ray_light": page_aligned((number * count,))
        }  # fmt: skip
        numbers = record(NUMBERS, points=number, count=count, first=0, emitter_share=0)
        self._launch(self._reflect, numbers, results, kept=self.device.shared(kept), **self._light)
        return _halves(results["sums"]), results["ray_light"]

    def _launch(
        self, kernel: Kernel, numbers: np.ndarray, results: dict[str, np.ndarray],
        **arguments: Any,
    ) -> None:  # fmt: skip
        """Run a kernel, which fills the arrays ``results``."""
        targets: dict[str, Any] = {
            name: self.device.target_buffer(array) for name, array in results.items()
        }
        workers = min(self.device.threads, int(numbers["points"]))
        kernel(workers, numbers=numbers, **arguments, **targets)
        for name, array in results.items():
            self.device.collect(targets[name], array)


def _halves(sums: np.ndarray) -> np.ndarray:
    """Return the sums (2, P, 3) of POINT_SUM."""
    return sums["halves"].reshape(-1, 2, 3).swapaxes(0, 1)
