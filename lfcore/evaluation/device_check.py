"""A device against the slow references: a small scene's hits and colours, in a process of its own.

    python -m lfcore.evaluation.device_check "part of a device's name"

prints the first error, or nothing.  A faulty driver may end the process.
"""

import subprocess
import sys

import numpy as np

from lfcore.errors import DeviceError
from lfcore.opencl.device import UPDATE, Device, open_device
from lfcore.optics import bundles
from lfcore.optics.camera import Camera
from lfcore.optics.slab import Slab
from lfcore.oracle.shading import shade
from lfcore.oracle.slab import all_pixels, slab_hits
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.appearance import POINT, Light
from lfcore.scene.model import Scene
from lfcore.scene.surface_mesh import Surface

LONGEST_S = 600
"""The time limit of a check, seconds."""
ROUNDINGS = 16
"""The error bound of depths, and the distance to edges within which hits are ambiguous, in units of
2^-24, as in docs/stability.md."""
UNLIKE = 0.01
"""The least difference of wrong colours, of 1."""
AT_SHADOWS = 2e-3
"""The largest share of rays near a shadow's edge, where colours are ambiguous."""


def check_apart(name: str) -> str:
    """The first error of the device of that name, and the remedy; empty without errors."""
    problem = _problem(name)
    return problem and f"{problem}. {UPDATE}"


def _problem(name: str) -> str:
    try:
        result = subprocess.run(command(name), capture_output=True, text=True, timeout=LONGEST_S)
    except subprocess.TimeoutExpired:
        return f"does not finish within {LONGEST_S} s"
    if result.returncode < 0:
        return f"ends the process by signal {-result.returncode}"
    if result.returncode:
        return (result.stderr.strip().splitlines() or ["ends the process"])[-1]
    return result.stdout.strip()


def command(name: str) -> list[str]:
    """The command that checks the device of that name in a separate process."""
    return [sys.executable, "-m", __name__, name]


def check(device: Device) -> str:
    """The first error of an open device; empty without errors."""
    scene = _scene()
    slab, tracer = Slab(scene.camera, 16, 12), open_tracer(scene, device)
    pixels = all_pixels(slab)
    truth = slab_hits(scene, slab, pixels)
    triangle, depth = (part.reshape(-1) for part in tracer.slab_hits(slab, pixels))
    clear, hit = truth.clear(ROUNDINGS), truth.triangle >= 0
    wrong = clear & (triangle != truth.triangle)
    depth_error = np.abs(depth[hit] / truth.t[hit] - 1)
    wrong[hit] |= clear[hit] & ~(depth_error < ROUNDINGS * 2.0**-24 * truth.grazing[hit])
    if wrong.any():
        return f"{wrong.sum()} of {len(wrong)} hits are wrong"
    rays = bundles.macropixels(slab, pixels)
    expected = shade(scene, rays.rays()[1].reshape(-1, 3), truth)
    colours = np.clip(tracer.bundle_radiance(rays, pixels).reshape(-1, 3), 0, 1)
    unlike = clear & ~(np.abs(colours - expected).max(1) < UNLIKE)
    if unlike.sum() > AT_SHADOWS * len(unlike):
        return f"{unlike.sum()} of {len(unlike)} colours are wrong"
    return ""


def _scene() -> Scene:
    """Random triangles before a wall, lit by a point light."""
    rng = np.random.default_rng(3)
    middle = rng.uniform([-0.7, -0.7, 0.8], [0.7, 0.7, 3.0], (40, 1, 3))
    wall = [[[-9, -9, 4], [9, -9, 4], [9, 9, 4]], [[-9, -9, 4], [9, 9, 4], [-9, 9, 4]]]
    triangles = np.concatenate([middle + rng.normal(size=(40, 3, 3)) * 0.25, wall])
    return Scene.from_triangles(
        triangles,
        surface=Surface(diffuse=(0.7, 0.6, 0.5), specular=(0.3, 0.3, 0.3), shininess=20.0),
        camera=Camera(0.05, 0.036, f_number=1.0, focus_m=2.0),
        lights=[Light(POINT, (1.0, -2.0, 0.5), (0.9, 0.8, 0.7), 2.0)],
    )


if __name__ == "__main__":
    try:
        print(check(open_device(sys.argv[1])))
    except DeviceError as error:
        print(error.problem)
