"""COLMAP's own reader of text models; points are projected by its cameras."""

import json
import sys

import numpy as np
import pycolmap

folder, points, out = sys.argv[1:]
model = pycolmap.Reconstruction()
model.read_text(folder)
pixels = []
for image in sorted(model.images.values(), key=lambda image: image.name):
    pose = image.cam_from_world
    pose = pose() if callable(pose) else pose
    local = np.array(json.loads(points)) @ pose.rotation.matrix().T + pose.translation
    camera = model.cameras[image.camera_id]
    pixels.append([camera.img_from_cam(point) for point in local])
np.savez(out, pixels=np.array(pixels, float))
