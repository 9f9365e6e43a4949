"""Columns of one of the thesis's tables over N, ours and the thesis's."""

import pandas as pd

from lfcore.evaluation.figures import curves_over_n
from workflow.job import job

QUALITY = {
    "PSNR (dB)": ("psnr_db", "thesis_psnr_db"),
    "SSIM": ("ssim", "thesis_ssim"),
}
SIZE = {
    "size (bytes)": ("video_bytes", "thesis_video_bytes"),
    "ratio to 8-bit RGB": ("ratio_uint8", "thesis_ratio_uint8"),
}
SECONDS = {"seconds": ("seconds", "thesis_seconds")}

with job(snakemake):
    panels = (SIZE if snakemake.wildcards.table == "table_7_2" else QUALITY) | SECONDS
    table = pd.read_csv(snakemake.input[0])
    curves_over_n(snakemake.output[0], table, panels, log_y=["seconds", "size (bytes)"])
