"""Rows of the thesis's tables for one scene: pictures against pictures, seconds, sizes."""

import numpy as np

from lfcore.colour import display_values
from lfcore.evaluation.metrics import psnr, ssim
from lfcore.evaluation.tables import sizes
from lfcore.files import read_json, write_json
from lfcore.optics.plane_pictures import load_stack
from workflow.job import job


def values(stack_file):
    """Pictures of a stack on the scale of 8-bit sRGB codes, not rounded."""
    return display_values(load_stack(stack_file)[0])


def quality(pictures, references):
    """Averages over the planes of PSNR in dB and SSIM."""
    pairs = list(zip(pictures, references, strict=True))
    return {
        "psnr_db": float(np.mean([psnr(a, b, peak=255) for a, b in pairs])),
        "ssim": float(np.mean([ssim(a, b, peak=255) for a, b in pairs])),
    }


with job(snakemake):
    given, rows = snakemake.input, {"table_7_1": [], "table_7_2": [], "table_7_3": []}
    best = values(given.on_the_fly[-1])
    for index, views in enumerate(snakemake.params.angular_resolutions):
        traced, pictures = (
            read_json(given.trace[index]),
            values(given.on_the_fly[index]),
        )
        context = {"scene": snakemake.wildcards.scene, "N": views}
        context["M"] = snakemake.params.spatial_resolution
        context |= {key: traced[key] for key in ("triangles", "device", "threads")}
        rows["table_7_1"].append(context | {"seconds": traced["seconds"]} | quality(pictures, best))
        if "store" not in given.keys():
            continue
        stored, retrieved = read_json(given.store[index]), read_json(given.retrieve[index])
        seconds = {"seconds": stored["encode_seconds"] + stored["join_seconds"]}
        size = sizes(rays=traced["rays"], video_bytes=stored["video_bytes"])
        context |= {key: stored[key] for key in ("device", "threads")}
        rows["table_7_2"].append(context | seconds | size)
        context |= {key: retrieved[key] for key in ("device", "threads", "seconds")}
        rows["table_7_3"].append(context | quality(values(given.from_video[index]), pictures))
    # JSON knows no infinity: the quality of a picture against itself is null here.
    for row in rows["table_7_1"]:
        row["psnr_db"] = row["psnr_db"] if np.isfinite(row["psnr_db"]) else None
    write_json(snakemake.output[0], rows)
