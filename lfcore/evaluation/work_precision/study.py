"""All points of one scene."""

from collections.abc import Iterable, Iterator, Mapping

from lfcore.evaluation.true_picture import Reference
from lfcore.evaluation.work_precision.files import codec_rows, recorded_row
from lfcore.evaluation.work_precision.in_memory import memory_rows
from lfcore.evaluation.work_precision.on_the_fly import by_depth_rows, nearest_rows, quality_rows
from lfcore.evaluation.work_precision.peers import peer_rows
from lfcore.optics.lattice import Lattice
from lfcore.progress import Progress, silent
from lfcore.tracing.tracer import Tracer


def scene_rows(
    tracer: Tracer,
    wide: Reference,
    stopped: Reference,
    grids: Iterable[dict],
    study: Mapping,
    *,
    progress: Progress = silent,
) -> list[dict]:
    """The rows of a scene, with the columns of :mod:`~lfcore.evaluation.work_precision.points`.

    ``wide`` and ``stopped`` are the true pictures through the open lens and the stopped-down one,
    ``grids`` the rows of the workflow's own light fields, ``study`` the keys of
    ``analysis.work_precision``.
    """
    scene, device = tracer.scene, tracer.device
    lattices = [Lattice(int(views), subpixels) for views, subpixels in study["lattices"]]
    views, subpixels = study["codec_lattice"]
    stored = Lattice(int(views), subpixels)
    parts: list[Iterator[dict]] = [
        iter(grids),
        nearest_rows(tracer, stopped, study["nearest_views"]),
        *(by_depth_rows(tracer, reference, lattices) for reference in (wide, stopped)),
        *(quality_rows(tracer, reference, study["qualities_db"]) for reference in (wide, stopped)),
        peer_rows(scene, wide.planes, wide.size, study["peers_db"]),
        (recorded_row(scene, wide, lattice, device) for lattice in lattices),
        codec_rows(scene, wide, stored, study["codecs"], study["crfs"], device),
        memory_rows(tracer, wide, study["memory_views"], study["monte_carlo_samples"]),
    ]
    rows: list[dict] = []
    for done, part in enumerate(parts, 1):
        rows += [{**row, "scene": scene.name} for row in part]
        progress(done, len(parts))
    return rows
