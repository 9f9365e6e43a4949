"""What rays of six small scenes give, to the last bit: one digest for each piece of work.

    PYTHONPATH=tests python tests/tracing/digests.py --write

remakes the table beside this file.  Every processor is held to the table, so that one that gives
other bits is found out.  The table is remade when a change of the program means to change bits,
and for nothing else.
"""

import argparse
import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import tracing_scenes
from tracing_scenes import LAMP, WALL, baked, curved, lit_soup, scene, soup, unit

from lfcore import Device, Encoding, Scene, SensorPlane, Slab, open_device, record
from lfcore.optics import bundles
from lfcore.rendering.tiles import trace_tile
from lfcore.scene.appearance import DIRECTIONAL, Light, Material
from lfcore.storage.layout import FrameLayout
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

TABLE = Path(__file__).with_suffix(".json")
CAMERA = dataclasses.replace(tracing_scenes.CAMERA, focus_m=3.0)
PLANES = [
    SensorPlane(2.0, 1.0),
    SensorPlane(0.7, 1.4),
    SensorPlane(4.0, 1.2, "polygon", blades=5, rotation_deg=10.0),
    SensorPlane(float("inf"), 1.1, "diamond", normalise="lens"),
]


SUN = Light(DIRECTIONAL, unit(-0.15, -0.25, -0.95), (0.3, 0.35, 0.4))


def textured_soup() -> Scene:
    """Flat triangles with a texture, far and near, in three lights, two of which cast shadows."""
    rng = np.random.default_rng(11)
    triangles = np.concatenate([soup(120, 9, 0.5), WALL]).astype(np.float32)
    return scene(
        triangles,
        uvs=(triangles[..., :2] * 3).astype(np.float32),
        textures=[rng.integers(0, 256, (48, 40, 3), np.uint8)],
        materials=[Material("tiles", (0.7, 0.6, 0.5), (0.2, 0.2, 0.2), 30.0, texture=0)],
        lights=[
            LAMP,
            SUN,
            Light(DIRECTIONAL, unit(1.0, 0.0, -0.1), (0.2, 0.1, 0.1), 0.0, False),
        ],
    )


def fine_soup() -> Scene:
    """Many small triangles with colours at their corners, in the sun."""
    triangles = soup(20_000, 4, 0.05).astype(np.float32)
    colours = np.random.default_rng(5).random(triangles.shape).astype(np.float32)
    return scene(triangles, colours=colours, lights=[SUN])


def holes_and_metal() -> Scene:
    """Flat triangles with holes, of metal, their normals bent, in lights that cast shadows."""
    rng = np.random.default_rng(12)
    triangles = np.concatenate([soup(150, 14, 0.6), WALL]).astype(np.float32)
    shapes = (24, 20, 4), (12, 12, 3), (16, 16, 3), (8, 8, 3)
    maps = {"metal_texture": 1, "normal_texture": 2, "emission_texture": 3}
    glow, factors = (0.1, 0.2, 0.1), {"metallic": 0.9, "roughness": 0.8}
    materials = [
        Material(
            "all", (0.9, 0.8, 0.7), emission=glow, texture=0, alpha_cutoff=0.4, **maps, **factors
        ),
        Material("gloss", (0.7, 0.6, 0.5), (0.3, 0.3, 0.3), 20.0, texture=0),
    ]
    return scene(
        triangles,
        uvs=(triangles[..., :2] * 3).astype(np.float32),
        textures=[rng.integers(0, 256, shape, np.uint8) for shape in shapes],
        materials=materials,
        material_ids=(np.arange(len(triangles)) % 2).astype(np.int32),
        lights=[LAMP, SUN],
    )


def under_a_sky() -> Scene:
    """Light baked on grids of many sizes, and the sky beside triangles."""
    return baked(soup(60, 2, 0.5), 1)


def glass_and_mirror() -> Scene:
    """Flat triangles with colours: mirrors, tinted glass, coats and veils before a wall."""
    triangles = np.concatenate([soup(80, 21, 0.6), WALL]).astype(np.float32)
    glass = {"transmission": 0.9, "attenuation_distance_m": 0.4}
    materials = [
        Material("mirror", (0.9, 0.8, 0.7), metallic=1.0, roughness=0.0),
        Material("glass", ior=1.4, attenuation_colour=(0.9, 0.5, 0.3), **glass),
        Material("coat", (0.5, 0.4, 0.3), clearcoat=0.8),
        Material("veil", opacity=0.4),
        Material("matt"),
    ]
    colours = np.random.default_rng(22).random(triangles.shape).astype(np.float32)
    numbers = np.arange(len(triangles), dtype=np.int32) % 5
    return scene(
        triangles, colours=colours, materials=materials, material_ids=numbers, lights=[SUN]
    )


WORLDS: dict[str, Callable[[], Scene]] = {
    "lit": lit_soup, "textured": textured_soup, "fine": fine_soup, "holes": holes_and_metal,
    "curved": lambda: curved([LAMP, SUN]), "sky": under_a_sky,
    "glass": glass_and_mirror,
}  # fmt: skip
Case = Callable[[Tracer], Iterator[np.ndarray]]


def hits(kind: str, views: int, pixels: int) -> Case:
    """Triangle and depth of every ray of some elements that lie side by side."""

    def run(tracer: Tracer) -> Iterator[np.ndarray]:
        slab = Slab(CAMERA, views, pixels)
        size = pixels if kind == "macropixels" else views
        places = np.argwhere(np.ones((min(size, 12),) * 2)) + max(0, size // 2 - 6)
        yield from tracer.bundle_hits(getattr(bundles, kind)(slab, places), places)

    return run


def single(tracer: Tracer) -> Iterator[np.ndarray]:
    """Triangle, distance and weights of rays from anywhere to anywhere."""
    rng = np.random.default_rng(6)
    origins, ends = rng.random((2, 4000, 3)) * [2, 2, 4] - [1, 1, 0]
    yield from tracer.closest_hit(origins, ends - origins)


def light_and_depth(views: int, pixels: int) -> Case:
    """Light and depth of some views, as pictures by depth are made of."""

    def run(tracer: Tracer) -> Iterator[np.ndarray]:
        places = np.argwhere(np.ones((2, 3))) + 1
        yield from tracer.radiance_and_depth(bundles.views(Slab(CAMERA, views, pixels), places))

    return run


def parts(tracer: Tracer) -> Iterator[np.ndarray]:
    """Light and depth of surfaces, and of what they mirror or let pass."""
    views = bundles.views(Slab(CAMERA, 3, 40), np.array([[0, 0], [2, 1]]))
    for part in tracer.parts(views):
        yield from part


def given(kind: str) -> Case:
    """Light or surfaces of rays from anywhere to anywhere."""

    def run(tracer: Tracer) -> Iterator[np.ndarray]:
        rng = np.random.default_rng(7)
        origins, ends = rng.random((2, 2000, 3)) * [2, 2, 4] - [1, 1, 0]
        rays = origins, ends - origins
        found = getattr(tracer, f"hit_{kind}")(*rays, tracer.closest_hit(*rays), filtered=0.01)
        yield from found if kind == "surfaces" else [found]

    return run


def tiles(kind: str, views: int, pixels: int, form: str = "yuv420p") -> Case:
    """Frames of two tiles in the middle, and what they add to planes."""

    def run(tracer: Tracer) -> Iterator[np.ndarray]:
        slab = Slab(CAMERA, views, pixels)
        layout = FrameLayout(kind, views, pixels, pixel_format=form)
        outer = layout.outer.width
        size = min(outer, 24)
        left = (outer - size) // 2
        for row, rows in ((left, size // 2), (left + size // 2, size - size // 2)):
            tracing = trace_tile(tracer, slab, layout.tile(left, row, size, rows), PLANES)
            for chunk in tracing:
                yield chunk.frames.copy()
            yield tracing.plane_sums.sums

    return run


def files(depth: bool, **refocus: Any) -> Case:
    """Pictures of a lossless file: refocused, and with depth views from between the recorded."""

    def run(tracer: Tracer) -> Iterator[np.ndarray]:
        world, device = tracer.scene, tracer.device
        spec = Encoding("ffv1", preset=None, tune=None, depth=depth)
        with TemporaryDirectory() as folder:
            path = Path(folder, "a.mkv")
            field = record(world, path, views=4, pixels=24, encoding=spec, device=device)
            planes = PLANES[1:3] if refocus.get("filter") else PLANES
            yield field.refocus_many(planes, device=device, **refocus)
            if depth:
                points = np.array([(0, 0), (0.3, -0.2), (1.4, 1.1)]) * field.slab.lens_pitch_m
                yield field.views_at(points, device=device)
                yield field.depth(samples=[(0, 3)], device=device)

    return run


# (scene, name).  Few lens samples of many pixels make blocks that span pixels, others packets of a
# pixel each; small triangles in few pixels make rays that are followed one by one.
CASES: dict[tuple[str, str], Case] = {
    ("fine", "hits, N = 4"): hits("macropixels", 4, 96),
    ("fine", "hits, N = 8"): hits("macropixels", 8, 96),
    ("fine", "hits, N = 16"): hits("macropixels", 16, 96),
    ("fine", "hits, N = 64"): hits("macropixels", 64, 24),
    ("fine", "hits of views"): hits("views", 6, 50),
    ("fine", "single rays"): single,
    ("fine", "frames and planes, N = 2"): tiles("macropixels", 2, 6),
    ("fine", "frames and planes, N = 8"): tiles("macropixels", 8, 96),
    ("holes", "hits, N = 8"): hits("macropixels", 8, 24),
    ("holes", "frames and planes, N = 8"): tiles("macropixels", 8, 24),
    ("holes", "single rays"): single,
    ("lit", "frames and planes, N = 4"): tiles("macropixels", 4, 512),
    ("lit", "frames and planes, N = 8"): tiles("macropixels", 8, 24),
    ("lit", "frames and planes, N = 64"): tiles("macropixels", 64, 5),
    **{(world, "light and depth"): light_and_depth(5, 40) for world in WORLDS},
    **{(world, "light of given rays"): given("radiance") for world in ("lit", "holes", "sky")},
    ("holes", "surfaces of given rays"): given("surfaces"),
    ("glass", "two parts"): parts,
    ("textured", "frames and planes, N = 16"): tiles("macropixels", 16, 12, "yuv444p10le"),
    ("textured", "views, N = 4"): tiles("views", 4, 40),
    ("textured", "a file with depth"): files(True),
    ("textured", "a file with depth, magnified"): files(True, pixels=70),
    ("textured", "a file of views, sliced"): files(False),
    ("textured", "a file of views, shifted"): files(False, filter="bilinear"),
}


@cache
def tracer_of(world: str, device: Device) -> Tracer:
    made = WORLDS[world]()
    return Tracer(made, build_bvh(made.triangles), device)


def digest(world: str, name: str, device: Device) -> str:
    """16 hexadecimal digits of every bit that one case gives on a device."""
    found = hashlib.sha256()
    for array in CASES[world, name](tracer_of(world, device)):
        found.update(f"{array.dtype} {array.shape}".encode())
        found.update(np.ascontiguousarray(array).tobytes())
    return found.hexdigest()[:16]


def table(device: Device, chosen: list[str] | None = None) -> dict[str, str]:
    """``scene: case`` -> digest, of all cases or of those ``chosen``."""
    names = {f"{world}: {name}": (world, name) for world, name in CASES}
    return {key: digest(*names[key], device) for key in chosen or names}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help=f"remake {TABLE.name}")
    parser.add_argument("--case", action="append", help="one case of the table, or several")
    options = parser.parse_args()
    text = json.dumps(table(open_device(), options.case), indent=2) + "\n"
    if options.write:
        TABLE.write_text(text, encoding="utf-8")
    print(text, end="")


if __name__ == "__main__":
    main()
