"""Read light fields with EPINET's own loader: SOURCE, FOLDER of scenes and output."""

import os
import sys
import tempfile
from pathlib import Path

import numpy as np

source, folder, out = sys.argv[1:]
sys.path.insert(0, source)
from epinet_fun.func_generate_traindata import generate_traindata512  # noqa: E402
from epinet_fun.func_makeinput import make_multiinput  # noqa: E402
from epinet_fun.util import load_LFdata  # noqa: E402

scenes = sorted(Path(folder).resolve().iterdir())
out = Path(out).resolve()
with tempfile.TemporaryDirectory() as place:
    os.chdir(place)  # its paths begin with hci_dataset/
    os.symlink(scenes[0].parent, "hci_dataset")
    views, disparity = load_LFdata([scene.name for scene in scenes])
    tested = make_multiinput(f"hci_dataset/{scenes[0].name}", 512, 512, range(9))
    os.chdir("/")
trained = generate_traindata512(views, disparity, np.arange(9))
inputs = np.stack([one[0] for one in tested]), np.stack([one[0] for one in trained[:4]])
np.savez(out, views=views[0].transpose(2, 3, 0, 1, 4), disparity=disparity[0],
         apart=np.abs(inputs[0] - inputs[1]).max(), inputs=inputs[0].shape)  # fmt: skip
