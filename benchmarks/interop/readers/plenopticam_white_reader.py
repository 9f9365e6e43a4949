"""PlenoptiCam's calibration: the centres of micro images in a white picture."""

import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
from plenopticam.cfg import PlenopticamConfig
from plenopticam.lfp_calibrator import LfpCalibrator
from plenopticam.misc import PlenopticamStatus, load_img_file

white, out = sys.argv[1:]
with tempfile.TemporaryDirectory() as folder:
    copy = Path(folder) / "white.png"  # it writes beside the picture
    shutil.copy(white, copy)
    cfg = PlenopticamConfig()
    cfg.default_values()
    cfg.params[cfg.cal_path] = cfg.params[cfg.lfp_path] = str(copy)
    LfpCalibrator(load_img_file(str(copy)), cfg, PlenopticamStatus()).main()
    np.savez(out, centres=np.array(cfg.calibs[cfg.mic_list], float))
