"""Area lights of pbrt scenes: the light on a floor below them, traced, against closed forms.

    python benchmarks/area_lights.py

The emitter is 1 m wide, 1 m above a diffuse floor of 8 m (a sphere's centre is), which the camera
sees from the side.  A row has the relative error of the worst pixel, and the 99th percentile.
"""

import argparse
import tempfile
from pathlib import Path

import numpy as np

from lfcore.optics.bundles import Bundles
from lfcore.oracle import area_lights as closed_forms
from lfcore.scene.pbrt import build_pbrt_scene
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

PIXELS, WIDTH, RADIANCE = 96, 1.1, 10.0
QUAD = 'Shape "trianglemesh" "integer indices" [0 1 2 0 2 3] "point P" [{}]'
SCENE = """
LookAt 2.5 3 0  2.5 0 0  0 0 1
Camera "perspective"
WorldBegin
Material "matte" "rgb Kd" [1 1 1]
{floor}
AttributeBegin
Material "matte" "rgb Kd" [0 0 0]
AreaLightSource "diffuse" "rgb L" [10 10 10]
Translate 0 1 0
{emitter}
AttributeEnd
WorldEnd
"""


EMITTERS = {
    "sphere": ('Shape "sphere" "float radius" 0.5', closed_forms.sphere),
    "disk": ('Rotate 90 1 0 0 Shape "disk" "float radius" 0.5', closed_forms.disk),
    "square": (QUAD.format("-.5 0 -.5  .5 0 -.5  .5 0 .5  -.5 0 .5"), closed_forms.square),
}


def floors(emitter: str, points: int) -> tuple[np.ndarray, np.ndarray]:
    """The floor's radiance, traced (PIXELS, PIXELS, 3) and by its closed form (PIXELS, PIXELS)."""
    shape, closed = EMITTERS[emitter]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.pbrt"
        floor = QUAD.format("-9 0 -9  -9 0 9  9 0 9  9 0 -9")
        path.write_text(SCENE.format(floor=floor, emitter=shape), encoding="ascii")
        scene = build_pbrt_scene(path, light_points=points)
    step = WIDTH / PIXELS
    middle, steps = np.zeros((1, 4), np.float32), np.array([0, 0, step, step], np.float32)
    pinhole = Bundles(middle, steps, PIXELS, PIXELS, pixel_pitch=step)
    seen = Tracer(scene, build_bvh(scene.triangles)).bundle_radiance(pinhole)[0]
    across = pinhole.rays()[1][0]
    truth = RADIANCE * closed(2.5 + 3 * across[..., 0], -3 * across[..., 1]) / np.pi
    return seen, truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--points", type=int, nargs="+", default=[4, 12, 48])
    arguments = parser.parse_args()
    print("emitter points worst_percent percentile_99")
    for name in EMITTERS:
        for points in arguments.points:
            seen, truth = floors(name, points)
            off = 100 * np.abs(seen[..., 0] / truth - 1)  # it is grey
            print(f"{name} {points} {off.max():.2f} {np.percentile(off, 99):.2f}", flush=True)


if __name__ == "__main__":
    main()
