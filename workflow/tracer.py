"""The tracer of a job: of its rule's scene, device and threads."""

from lfcore.opencl.device import open_device
from lfcore.scene.files import load_scene
from lfcore.tracing.bvh import load_bvh
from lfcore.tracing.tracer import Tracer


def open_tracer(snakemake) -> Tracer:
    """Of ``input.scene`` and ``input.bvh`` on ``params.device``, with the rule's threads."""
    device = open_device(snakemake.params.device or None, threads=snakemake.threads)
    return Tracer(load_scene(snakemake.input.scene), load_bvh(snakemake.input.bvh), device)
