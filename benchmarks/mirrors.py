"""Compares mirrors, glass, a coat and a veil with Mitsuba: python -m benchmarks.mirrors --out x.csv

Scenes in even light: surfaces emit their own colours, so only mirrored and passing rays differ.
Mitsuba's path tracer converges through the same thin lens, with paths of the same length.
*quality*: dB of our pictures from 64 rays per pixel, on the pixels of the mirror, with its surface
in focus and with the image in it; and of Mitsuba's, denoised, after as many core seconds.  *price*:
a mirror covers a tenth of the picture; core seconds, divided by those with a matt surface there.
Rows of other scenes and parts stay.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from benchmarks.light import true_psnr, truth_of
from benchmarks.mirror_scenes import CASES, MIRROR, Case, plane_mirror
from benchmarks.peers.method import Renderer, Samples
from benchmarks.peers.mitsuba import mitsuba_even
from benchmarks.results import parser_of, report, said, with_kept
from benchmarks.sample import SCENES
from lfcore.evaluation.figures import contact_sheet
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Lattice
from lfcore.readers.load import load_scene
from lfcore.rendering.by_depth import pictures_by_depth
from lfcore.rendering.direct import focused_camera
from lfcore.rendering.prepared import hierarchy_of, opened
from lfcore.scene.model import Scene
from lfcore.timing import measure_in_turn
from lfcore.tracing.specular import MOST_EVENTS
from lfcore.tracing.tracer import Tracer

LATTICE = Lattice(4, 2)
"""The 64 rays per pixel of our pictures."""
DENOISED = "Mitsuba path + OIDN, equal time"
TENTH = 0.1
PRICED_PIXELS = 256
"""The longer side of the pictures whose price is measured."""
SHINY = {"bike": "sandstone", "bedroom": "floor"}
"""Materials of a tenth of the pixels, which become a mirror."""


def quality(name: str, case: Case, options: argparse.Namespace, kept: dict) -> Iterator[dict]:
    """Yield rows of our pictures and of Mitsuba's after equal time."""
    scene = case.scene(name)
    tracer = Tracer(scene, hierarchy_of(scene), opened(None))
    peer = mitsuba_even(scene, case.balls, MOST_EVENTS, options.threads)
    where = shown(tracer, case, options.pixels)
    planes = [SensorPlane(z, scene.camera.f_number) for z in (case.surface_m, case.image_m)]
    pictures_by_depth(tracer, scene.camera, planes[:1], 16, LATTICE)  # programs
    for number, (plane, focus) in enumerate(zip(planes, ("surface", "image"), strict=True)):
        camera = focused_camera(scene.camera, plane)
        truth = np.array([truth_of(peer, camera, options, 1 + number)])
        begun = time.process_time()
        ours = pictures_by_depth(tracer, scene.camera, [plane], options.pixels, LATTICE)
        seconds = time.process_time() - begun
        theirs, samples, spent = after(peer, camera, options.pixels, seconds)
        for setting, picture, took in (
            (f"{LATTICE}", ours[0], seconds), (f"{DENOISED}", theirs, spent)
        ):  # fmt: skip
            yield said({
                "scene": name, "part": "quality", "setting": setting, "focus": focus,
                "core s": f"{took:.3g}", "pixels": f"{where.sum()}",
                "samples": f"{samples if picture is theirs else LATTICE.rays_per_pixel}",
                "dB": f"{true_psnr(picture[None], truth, where):.1f}",
                "dB, all pixels": f"{true_psnr(picture[None], truth):.1f}",
            })  # fmt: skip
        near = truth[0, 2]
        kept |= {
            f"{name}, {focus}: converged": near, f"{focus}: ours": ours[0],
            f"{focus}: ours, off": 0.5 + 4 * (ours[0] - near),
            f"{focus}: Mitsuba + OIDN": theirs, f"{focus}: off": 0.5 + 4 * (theirs - near),
        }  # fmt: skip
    peer.close()


def after(peer: Renderer, camera, pixels: int, seconds: float) -> tuple[np.ndarray, int, float]:
    """Return Mitsuba's denoised picture after about as many core seconds, and what it took."""
    peer.picture(camera, pixels, Samples(4, "multijitter", "picture"))  # compiles
    _, few = peer.picture(camera, pixels, Samples(4, "multijitter", "picture"))
    _, more = peer.picture(camera, pixels, Samples(64, "multijitter", "picture"))
    samples = round(4 + 60 * (seconds - few) / max(more - few, 1e-6))
    samples = int(np.clip(samples, 1, 1024))
    picture, spent = peer.picture(camera, pixels, Samples(samples, "multijitter", "picture"), 7)
    return picture, samples, spent


def shown(tracer: Tracer, case: Case, pixels: int) -> np.ndarray:
    """Return the mask (M, M) of pixels whose central rays meet the special material."""
    tangents = (np.arange(pixels) + 0.5) / pixels - 0.5
    x, y = np.meshgrid(tangents, tangents)
    towards = np.stack([x, y, 0 * x], -1, dtype=np.float32).reshape(-1, 3)
    towards *= np.float32(tracer.scene.camera.field_width)
    towards[:, 2] = 1
    triangle = tracer.closest_hit(0 * towards, towards)[0]
    names = np.array([material.name for material in tracer.scene.every_material])
    hit = names[tracer.scene.material_ids[triangle]] == case.special
    return (hit & (triangle >= 0)).reshape(pixels, pixels)


def price(options: argparse.Namespace) -> Iterator[dict]:
    """Yield the time with a mirror on a tenth of the picture, divided by the time without."""
    for name, mirror, matt in tenths():
        tracers = [Tracer(scene, hierarchy_of(scene), opened(None)) for scene in (mirror, matt)]
        plane = SensorPlane(mirror.camera.focus_m, mirror.camera.f_number)
        works = [
            partial(pictures_by_depth, tracer, mirror.camera, [plane], PRICED_PIXELS, LATTICE)
            for tracer in tracers
        ]
        timings = measure_in_turn(works, repeats=options.repeats, clock=time.process_time)
        seconds, without = (min(timing.seconds) for timing in timings)
        yield said({
            "scene": f"{name}, a tenth", "part": "price", "setting": f"{LATTICE}", "focus": "",
            "core s": f"{seconds:.3g}", "price": f"{seconds / without:.2f}",
        })  # fmt: skip


def tenths() -> Iterator[tuple[str, Scene, Scene]]:
    """Yield names, scenes a tenth of whose pixels are a mirror, and the same scenes, matt."""
    case = plane_mirror()
    whole = next(part for part in case.parts if part.surface is MIRROR)
    middle = whole.triangles.reshape(-1, 3).mean(0)
    for size in np.linspace(1, 0.05, 40):
        small = replace(whole, triangles=middle + size * (whole.triangles - middle))
        scene = replace(
            case, parts=[small if part is whole else part for part in case.parts]
        ).scene("a tenth")
        tracer = Tracer(scene, hierarchy_of(scene), opened(None))
        if shown(tracer, case, 256).mean() <= TENTH:
            break
    yield "26 triangles", scene, _with(scene, "mirror", metallic=-1.0)
    for name, material in SHINY.items():
        scene = load_scene(SCENES / name)
        shining = _with(scene, material, metallic=1.0, roughness=0.0, texture=-1)
        yield name, shining, scene


def _with(scene: Scene, material: str, **changes: Any) -> Scene:
    """Return the scene with a changed material."""
    materials = [replace(m, **changes) if m.name == material else m for m in scene.materials]
    return replace(scene, materials=materials)


def main() -> None:
    parser = parser_of(__doc__ or "", scenes=(*CASES, "price"), pixels=128)
    parser.add_argument("--pictures", type=Path, help="folder of pictures and differences")
    parser.add_argument("--converged", type=int, default=1024, help="samples of converged pictures")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--note", default="", help="sentence below the table")
    options = parser.parse_args()
    rows: list[dict] = []
    for name in options.scenes:
        if name == "price":
            rows += price(options)
            continue
        kept: dict[str, np.ndarray] = {}
        rows += quality(name, CASES[name](), options, kept)
        if options.pictures:
            cells = [(np.clip(picture, 0, 1), label) for label, picture in kept.items()]
            contact_sheet(options.pictures / f"{name.replace(' ', '_')}.png", cells, 5)
    made = pd.DataFrame(rows).fillna("")
    table = with_kept(made, options.out, "scene", "part", "setting", "focus")
    columns = ["scene", "setting", "focus", "core s", "samples", "dB", "price", "commit"]
    shown_rows = table[[column for column in columns if column in table]]
    report(options.out, "python -m benchmarks.mirrors", table, options.note, {"": shown_rows})


if __name__ == "__main__":
    main()
