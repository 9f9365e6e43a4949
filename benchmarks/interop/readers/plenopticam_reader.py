"""PlenoptiCam: an aligned plenoptic picture to viewpoints, and its picture loader."""

import sys
from pathlib import Path

import numpy as np
from plenopticam.cfg import PlenopticamConfig
from plenopticam.lfp_extractor import LfpRearranger
from plenopticam.misc import PlenopticamStatus, load_img_file

eslf, views, side, out = sys.argv[1:]
cfg = PlenopticamConfig()
cfg.default_values()
cfg.params[cfg.ptc_leng] = int(side)
picture = load_img_file(eslf)
obj = LfpRearranger(picture, cfg=cfg, sta=PlenopticamStatus())
obj._size_pitch = int(side)
obj.main()
single = load_img_file(str(Path(views) / "view_002_002.png"))
# It scales pictures to the range from 0 to 1.
made = {"rearranged": obj.vp_img_arr, "single": single}
np.savez(out, **{key: np.rint(255 * value).astype(np.uint8) for key, value in made.items()})
