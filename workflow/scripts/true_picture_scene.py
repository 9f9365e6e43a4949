"""True errors of one scene's pictures, by method and lattice."""

from lfcore.evaluation.true_picture.peers import peer_rows
from lfcore.evaluation.true_picture.points import NEAREST, method_rows, plane_rows
from lfcore.evaluation.true_picture.reference import load_reference
from lfcore.files import read_json, write_json
from lfcore.optics.lattice import Lattice
from lfcore.optics.plane_pictures import load_stack
from lfcore.workflow.job import job
from lfcore.workflow.tracers import open_tracer

with job(snakemake.log[0], snakemake.threads):
    given, params = snakemake.input, snakemake.params
    wide, stopped = load_reference(given.wide), load_reference(given.stopped)
    tracer, rows = open_tracer(given, params.device, snakemake.threads), []
    # The thesis's recipe was traced for its tables: its pictures are judged as they are.
    for views, stack, trace in zip(params.views, given.on_the_fly, given.trace, strict=True):
        traced = read_json(trace)
        rows += plane_rows(
            wide, load_stack(stack)[0], scene=tracer.scene.name, method=NEAREST,
            lattice=f"{views} x 1", rays=traced["rays"], seconds=traced["seconds"],
        )  # fmt: skip
    counts = [Lattice(int(views), subpixels) for views, subpixels in params.study["lattices"]]
    asked = params.study["qualities_db"]
    rows += method_rows(tracer, [wide], counts, [], asked, params.study["peers_db"])
    rows += peer_rows(tracer.scene, wide.planes, wide.pixels, params.study["peers_db"])
    rows += method_rows(tracer, [stopped], counts, params.study["nearest_views"], asked)
    device = tracer.device
    write_json(
        snakemake.output[0], {"device": device.name, "threads": device.threads, "rows": rows}
    )
