"""Accepted scenes, traced by the device: no crash, and a picture of finite light."""

from pathlib import Path

import numpy as np

from lfcore.scene.build import build_scene
from robustness.children import Limits
from robustness.mutate import damage_text, mixed
from robustness.outcome import SilentlyWrong
from robustness.targets import Target, of_file
from robustness.targets.scenes import PLAIN, SHORT, write_sides
from robustness.trees import damage_yaml, extreme_yaml

PIXELS, VIEWS, MOST_TRIANGLES = 8, 2, 20_000


def seeds(folder: Path) -> list[bytes]:
    return [PLAIN.encode(), SHORT.encode()]


def check_traced(file: Path) -> None:
    from lfcore.opencl.device import open_device
    from lfcore.optics.planes import SensorPlane
    from lfcore.rendering.direct import trace_picture
    from lfcore.tracing.bvh import build_bvh
    from lfcore.tracing.tracer import Tracer

    scene = build_scene(file)
    if scene.triangle_count > MOST_TRIANGLES:
        return
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    camera = scene.camera
    plane = SensorPlane(camera.focus_m, camera.f_number)
    picture = trace_picture(tracer, camera, PIXELS, plane, views=VIEWS)
    if picture.shape != (PIXELS, PIXELS, 3):
        raise SilentlyWrong(f"a picture {picture.shape}")
    if not np.isfinite(picture).all() or picture.min() < 0:
        raise SilentlyWrong("a picture that is not finite or darker than black")


def targets() -> list[Target]:
    mutation = mixed((0.7, extreme_yaml), (0.2, damage_yaml), (0.1, damage_text))
    # Programs are built in a child, and drivers map much: no limit of the address space.
    limits = Limits(cpu=60, wall=300, memory=None)
    judge = of_file("input.yaml", check_traced, named=False)
    return [Target("trace", seeds, mutation, judge, write_sides, limits, weight=1.5, batch=400)]
