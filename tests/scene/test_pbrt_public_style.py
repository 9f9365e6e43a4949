"""A whole version 3 scene as the public ones are written: what is mapped, what is listed."""

import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest

from lfcore.cli import main
from lfcore.exr import read_exr_picture
from lfcore.scene.appearance import DIRECTIONAL, POINT
from lfcore.scene.pbrt import build_pbrt_scene

LISTED = {
    "left out": {
        'Texture "wrinkles"', 'MakeNamedMedium "fog"', 'MediumInterface "fog"', 'Shape "cone"',
        'Shape "curve"', 'Shape "paraboloid"', 'LightSource "goniometric"',
    },
    "approximated": {
        'LightSource "infinite"', 'LightSource "spot"', 'AreaLightSource "diffuse"',
        'Shape "plymesh": "alpha"', 'Material "matte" named "floor"', 'Material "metal"',
        'Material "mirror"', 'Material "mix" named "blend"', 'Material "glass"',
        'Material "subsurface"',
    },
    "not used": {
        'Integrator "volpath"', 'Sampler "halton"', 'PixelFilter "gaussian"', 'Accelerator "bvh"',
        'parameter "filename"', 'parameter "octaves"', 'parameter "I" of LightSource "gonio',
        'parameter "index"', 'parameter "name"',
    },
}  # fmt: skip


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    here = tmp_path_factory.mktemp("public") / "scene"
    shutil.copytree(Path(__file__).with_name("public_style"), here)
    (here / "textures").mkdir()
    grid = np.full((64, 64, 3), 60, np.uint8)
    grid[::8] = grid[:, ::8] = (0, 200, 255)
    cv2.imwrite(str(here / "textures" / "grid.png"), grid)
    return here


@pytest.fixture(scope="module")
def scene(folder):
    return build_pbrt_scene(folder / "scene.pbrt")


def test_everything_else_is_listed_with_file_and_line(scene, folder):
    lines = (folder / "scene.pbrt").read_text().splitlines()
    for kind, starts in LISTED.items():
        notes = [note for note in scene.notes if note.kind == kind]
        for start in starts:
            assert any(note.what.startswith(start) for note in notes), (kind, start)
        for note in notes:
            assert any(note.what.startswith(start) for start in starts), str(note)
            assert note.file == folder / "scene.pbrt"
            word = note.what.removeprefix("parameter ").split('"')[1]
            assert word in " ".join(lines[note.line - 1 : note.line + 2]), str(note)


def test_what_has_a_counterpart_is_there(scene):
    names = {material.name for material in scene.materials}
    assert len(names) == len(scene.materials) == 8
    kinds = [light.kind for light in scene.lights]
    # A point, a spot and the twelve points of the area light; one distant light.
    assert (kinds.count(POINT), kinds.count(DIRECTIONAL)) == (14, 1)
    np.testing.assert_allclose(scene.ambient, [0.3, 0.35, 0.4], rtol=1e-6)
    assert len(scene.textures) == 2
    (mixed,) = (k for k, name in enumerate(m.name for m in scene.materials) if "blend" in name)
    quads = scene.material_ids == mixed
    # Two instances of a quad of two triangles, 0.8 m wide.
    assert quads.sum() == 4
    first = scene.triangles[quads][:2].reshape(-1, 3)
    assert np.ptp(first[:, 0]) == pytest.approx(0.8, abs=1e-5)


@pytest.mark.kernels
def test_it_renders_as_the_file_says(folder, tmp_path):
    out = tmp_path / "out.exr"
    assert main(["render", str(folder / "scene.pbrt"), "-o", str(out), "--samples", "2"]) == 0
    picture = read_exr_picture(out)
    assert picture.shape == (100, 160, 3) and np.isfinite(picture).all()
    # Sky on top, the checked floor's contrast at the bottom.
    np.testing.assert_allclose(picture[0, 0], [0.3, 0.35, 0.4], rtol=1e-3)
    assert picture[70:].std() > 0.1
