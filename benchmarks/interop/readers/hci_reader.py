"""HCI's python-tools, turned to Python 3 in a temporary folder."""

import shutil
import subprocess
import sys
import tempfile
import types
from pathlib import Path

import imageio.v2 as imageio
import numpy as np

source, folder, out = sys.argv[1:]
with tempfile.TemporaryDirectory() as place:
    copy = Path(place) / "file_io.py"
    shutil.copy(Path(source) / "file_io.py", copy)
    subprocess.run([sys.executable, "-m", "lib2to3", "-w", "-n", str(copy)],
                   check=True, capture_output=True)  # fmt: skip
    text = copy.read_text().replace("idx / params", "idx // params")
    text = text.replace("f.readline().rstrip()", "f.readline().decode().rstrip()")
    copy.write_text(text.replace("parser.readfp", "parser.read_file"))
    misc = types.ModuleType("scipy.misc")
    misc.imread = imageio.imread
    scipy = types.ModuleType("scipy")
    scipy.misc = misc
    sys.modules |= {"scipy": scipy, "scipy.misc": misc}
    sys.path.insert(0, place)
    import file_io

    views = file_io.read_lightfield(folder)
    said = file_io.read_parameters(folder)
    with_depth = (Path(folder) / "gt_disp_lowres.pfm").exists()
    disparity = file_io.read_disparity(folder) if with_depth else np.zeros((0, 0))
keys = ("width", "height", "num_cams_x", "num_cams_y", "baseline_mm", "focus_distance_m")
np.savez(
    out,
    views=views,
    numbers=np.array([said[key] for key in keys], float),
    range=np.array([said["disp_min"], said["disp_max"]]),
    disparity=disparity,
)
