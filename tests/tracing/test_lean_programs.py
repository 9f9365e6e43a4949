"""Programs without the features that a scene lacks make the same frames and plane sums."""

import dataclasses
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from lfcore import SensorPlane, Slab, open_device
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.optics.bundles import views
from lfcore.rendering.tiles import trace_tile
from lfcore.scene.appearance import DIRECTIONAL, Light, Material
from lfcore.scene.baked import BakedLight
from lfcore.scene.needs import Needs
from lfcore.scene.surface_mesh import face_normals
from lfcore.storage.layout import FrameLayout
from lfcore.tracing import specular
from lfcore.tracing import tracer as tracer_module
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.surfaces import pack_surfaces
from lfcore.tracing.tracer import Tracer

TRIANGLES = np.float32([
    [[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]],
    [[-2, -2, 4], [2, -2, 4], [0, 2, 4]],
    [[-1, -1, -2], [1, -1, -2], [0, 1, -2]],
])  # fmt: skip
LIGHT = Light(DIRECTIONAL, (0.0, -0.6, -0.8), (1.0, 1.0, 1.0), casts_shadows=False)
IDLE = Light(DIRECTIONAL, (0.0, -1.0, 0.0), (1e-30,) * 3)
"""An additional light with shadows, so weak that it adds nothing, but not black."""
WHOLE = (SensorPlane(2.0, 2.0),)
NORMALS = np.repeat(face_normals(TRIANGLES.astype(float)).astype(np.float32)[:, None], 3, axis=1)


def black_light(scene):
    grids = np.tile(np.array([0, 0, 1], np.int32), (scene.triangle_count, 1))
    return replace(scene, light=BakedLight(grids, np.zeros((3, 3), np.float32)))


FILLED = {
    "textures": lambda scene: replace(
        scene, uvs=np.zeros((3, 3, 2), np.float32), textures=[np.full((2, 2, 3), 255, np.uint8)]
    ),
    "smooth_normals": lambda scene: replace(scene, normals=NORMALS),
    "curved": lambda scene: replace(scene, normals=NORMALS),
    "vertex_colours": lambda scene: replace(scene, colours=np.ones((3, 3, 3), np.float32)),
    "shadows": lambda scene: replace(scene, lights=[*scene.lights, IDLE]),
    "baked": black_light,
    "sky": lambda scene: replace(black_light(scene), sky=np.zeros((8, 8, 3), np.float32)),
    "stops": lambda scene: replace(scene, clip=False),
}
"""Neutral data of features, by their field of Needs; others have none."""
DEFINES = {
    "smooth_normals": "SMOOTH", "alpha_tests": "TEXTURES", "physical": "TEXTURES", "stops": None,
    "curved": None, "specular": None,
}  # fmt: skip
"""The kernels' macros of features that are not named as their field."""
FIELDS = [field.name for field in dataclasses.fields(Needs)]


def plain(field=""):
    """A scene that lacks all features, and has a triangle that nobody can see."""
    lights = [] if field == "stops" else [LIGHT]  # so dim that no ray is brighter than white
    dark = (0.0,) * 3
    return bare_scene(
        TRIANGLES, lights=lights, materials=[Material("grey", normal_scale=1.0)],
        ambient=dark, background=dark,
    )  # fmt: skip


def filled(field):
    """The plain scene with neutral data of a feature, and its needs with the feature."""
    scene = FILLED.get(field, lambda scene: scene)(plain(field))
    needs = Needs.of(scene)
    value = getattr(needs, field)
    return scene, replace(needs, **{field: value or type(value)(True)})


def results(scene, needs=None, planes=WHOLE, frames=True):
    """Frames and sums of planes."""
    slab = Slab(scene.camera, 16, 16)
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1), needs)
    tile = FrameLayout("macropixels", slab.views, slab.pixels).tile(0, 0, slab.pixels, slab.pixels)
    tracing = trace_tile(tracer, slab, tile, planes, frames=frames)
    whole = [chunk.frames.copy() for chunk in tracing]
    return np.concatenate(whole or [np.empty(0)]), tracing.plane_sums.sums


@pytest.mark.parametrize("field", FIELDS)
def test_the_full_program_is_fuller(field):
    """A new field fails here until it is known what switches it on."""
    assert not getattr(Needs.of(plain(field)), field)
    lean = pack_surfaces(plain(field), Needs.of(plain(field))).defines
    full = pack_surfaces(*filled(field)).defines
    define = DEFINES.get(field, field.upper())
    assert define is None or full[define] > lean[define]
    assert all(full[name] >= lean[name] for name in full)


@pytest.mark.kernels
@pytest.mark.parametrize("field", FIELDS)
def test_pictures_are_identical_without_what_a_scene_lacks(field):
    for lean, full in zip(results(plain(field)), results(*filled(field)), strict=True):
        np.testing.assert_array_equal(lean, full)


@pytest.mark.kernels
def test_frames_and_planes_are_the_same_alone():
    whole, narrow = SensorPlane(2.0, 2.0, aperture="square"), SensorPlane(2.0, 8.0)
    frames, sums = results(plain(), planes=[whole, narrow])
    np.testing.assert_array_equal(results(plain(), planes=[])[0], frames)
    np.testing.assert_array_equal(results(plain(), planes=[narrow], frames=False)[1][0], sums[1])


def test_a_picture_loads_no_video_library_and_none_that_filters_textures():
    program = f"""if True:
        import sys, lfcore
        scene = lfcore.Scene.from_triangles({TRIANGLES[:2].tolist()})
        assert lfcore.render(scene, pixels=16, views=2, filter="nearest").any()
        print({{"av", "cv2"}} & set(sys.modules))
        """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


@pytest.mark.parametrize("mirrors", [False, True])
def test_a_scene_without_mirrors_follows_no_paths(mirrors, monkeypatch):
    """No program of paths, no numbers of triangles beside light, no second part."""
    launched, outputs = [], []
    launch, fill = specular.launch_given, tracer_module.fill_arrays
    monkeypatch.setattr(
        specular, "launch_given", lambda *args, **more: launched.append(launch(*args, **more))
    )

    def noted(job, sets, places, arrays, **more):
        outputs.append(set(arrays))
        return fill(job, sets, places, arrays, **more)

    monkeypatch.setattr(tracer_module, "fill_arrays", noted)
    material = Material("grey", metallic=1.0, roughness=0.0 if mirrors else 0.5)
    scene = replace(plain(), materials=[material])
    tracer = Tracer(scene, build_bvh(scene.triangles), open_device(threads=1))
    rays = views(Slab(scene.camera, 2, 16), np.int32([[0, 0]]))
    assert len(tracer.parts(rays)) == 1 + mirrors
    tracer.bundle_radiance(rays)
    assert bool(launched) == mirrors
    assert all(("triangle" in names) == mirrors for names in outputs)
