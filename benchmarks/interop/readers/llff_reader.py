"""NeRF's loader of LLFF data: its axes, then points projected by a pinhole in the middle."""

import json
import sys

import numpy as np

source, folder, points, out = sys.argv[1:]
sys.path.insert(0, source)
import load_llff  # noqa: E402

poses, bounds = load_llff._load_data(folder, factor=None, load_imgs=False)
# As its load_llff_data goes on: [down, right, back] to [right, up, back].
poses = np.concatenate([poses[:, 1:2], -poses[:, 0:1], poses[:, 2:]], 1)
poses = np.moveaxis(poses, -1, 0)
world = np.array(json.loads(points)) * [1, -1, -1]
pixels = []
for pose in poses:
    height, width, focal = pose[:, 4]
    local = (world - pose[:, 3]) @ pose[:, :3]
    pixels.append(np.stack([focal * local[:, 0] / -local[:, 2] + width / 2,
                            -focal * local[:, 1] / -local[:, 2] + height / 2], -1))  # fmt: skip
np.savez(out, pixels=np.array(pixels), size=poses[0, [1, 0], 4], bounds=bounds.T)
