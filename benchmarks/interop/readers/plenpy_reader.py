"""plenpy's readers on a folder of views, a mosaic, microlens pictures and a MAT file."""

import sys
from pathlib import Path

import numpy as np
from plenpy.lightfields import LightField

folder, mosaic, eslf, mat, side, height, width, out = sys.argv[1:]
side, height, width = int(side), int(height), int(width)


def codes(light_field):
    return np.rint(255 * np.asarray(light_field)[..., :3]).astype(np.uint8)


np.savez(
    out,
    folder=codes(LightField.from_file_collection(Path(folder), side)),
    sai=codes(LightField.from_file(Path(mosaic), height, width, method="SAI")),
    mli=codes(LightField.from_file(Path(eslf), height, width, method="MLI")),
    mat=codes(LightField.from_mat_file(Path(mat))),
)
