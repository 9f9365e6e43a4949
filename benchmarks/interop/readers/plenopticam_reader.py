"""PlenoptiCam: an aligned plenoptic picture to viewpoints, its picture loader, and the centres of
micro images in a white picture by its calibration.
"""

import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from plenopticam.cfg import PlenopticamConfig
from plenopticam.lfp_calibrator import LfpCalibrator
from plenopticam.lfp_extractor import LfpRearranger
from plenopticam.misc import PlenopticamStatus, load_img_file

eslf, views, side, white, out = sys.argv[1:]
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
made = {key: np.rint(255 * value).astype(np.uint8) for key, value in made.items()}
with tempfile.TemporaryDirectory() as folder:
    copy = Path(folder) / "white.png"  # it writes beside the picture
    shutil.copy(white, copy)
    cfg = PlenopticamConfig()
    cfg.default_values()
    cfg.params[cfg.cal_path] = cfg.params[cfg.lfp_path] = str(copy)
    LfpCalibrator(load_img_file(str(copy)), cfg, PlenopticamStatus()).main()
    np.savez(out, **made, centres=np.array(cfg.calibs[cfg.mic_list], float))
