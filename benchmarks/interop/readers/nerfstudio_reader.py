"""nerfstudio's dataparser, in our frame; points are projected by its cameras."""

import json
import sys
from pathlib import Path

import numpy as np
from nerfstudio.data.dataparsers.nerfstudio_dataparser import NerfstudioDataParserConfig

folder, points, out = sys.argv[1:]
config = NerfstudioDataParserConfig(
    data=Path(folder), center_method="none", auto_scale_poses=False, orientation_method="none",
    eval_mode="all", downscale_factor=1,
)  # fmt: skip
made = config.setup().get_dataparser_outputs(split="train")
cameras = made.cameras
assert [path.name for path in made.image_filenames] == sorted(
    path.name for path in (Path(folder) / "images").iterdir()
)
x, y, z = np.array(json.loads(points)).T
world = np.stack([x, z, -y], -1)  # its world has z up, y forward
pixels = []
for k in range(len(made.image_filenames)):
    pose = cameras.camera_to_worlds[k].numpy().astype(float)
    local = (world - pose[:, 3]) @ pose[:, :3]
    fx, fy, cx, cy = (float(getattr(cameras, key)[k]) for key in ("fx", "fy", "cx", "cy"))
    pixels.append(np.stack([fx * local[:, 0] / -local[:, 2] + cx,
                            -fy * local[:, 1] / -local[:, 2] + cy], -1))  # fmt: skip
np.savez(out, pixels=np.array(pixels))
