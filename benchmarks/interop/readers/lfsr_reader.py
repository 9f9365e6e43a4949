"""Make training data with BasicLFSR's own script and read them with its loader: SOURCE, FOLDER/,
work folder and output.
"""

import os
import runpy
import sys
from types import SimpleNamespace

import numpy as np
import whole_torchvision  # noqa: F401

source, folder, work, out = sys.argv[1:]
sys.path.insert(0, source)
os.makedirs(work, exist_ok=True)
script = f"{source}/Generate_Data_for_Training.py"
# Its module `option` parses the command line at import, and knows none of the script's own words.
sys.argv = [script]
import option  # noqa: E402, F401

sys.argv = [script, "--angRes", "5", "--scale_factor", "2", "--src_data_path", folder,
            "--save_data_path", f"{work}/"]  # fmt: skip
runpy.run_path(script, run_name="__main__")
sys.argv = [script]
from utils.utils_datasets import TrainSetDataLoader  # noqa: E402

loader = TrainSetDataLoader(SimpleNamespace(
    angRes_in=5, angRes_out=5, task="SR", path_for_train=f"{work}/data_for_training/",
    scale_factor=2, data_name="ALL",
))  # fmt: skip
low, high, angles = loader[0]
np.savez(out, low=low.shape, high=high.shape, count=len(loader), range=[high.min(), high.max()])
