"""What is left out changes nothing, and every feature has its place in the registry."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest

from lfcore.evaluation.left_out import (
    COLUMNS,
    FEATURES,
    LeftOutError,
    check_identical,
    full_needs,
    left_out,
    same,
)
from lfcore.evaluation.stability.tested_tracer import bare_scene
from lfcore.opencl.device import open_device
from lfcore.scene.appearance import DIRECTIONAL, Light, Material
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.surfaces import pack_surfaces

TRIANGLES = np.array(
    [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]], np.float32
)
BEHIND = [[[-1, -1, -2], [1, -1, -2], [0, 1, -2]]]


@pytest.fixture(scope="module")
def plain():
    """A scene that needs nothing but one light, and has a triangle that nobody can see.

    The light casts no shadow: of the programs with all that the scene lacks, those with shadows are
    the dearest to build, and now two have them.
    """
    light = Light(DIRECTIONAL, (0.0, -0.6, -0.8), (1.0, 1.0, 1.0), casts_shadows=False)
    triangles = [*TRIANGLES, *BEHIND]
    return bare_scene(triangles, lights=[light], materials=[Material("grey")], ambient=(0.0,) * 3)


def test_every_feature_has_its_place():
    """A new field of Needs, or a new define, fails here until the registry says what it saves."""
    scene = bare_scene(TRIANGLES)
    assert {feature.field for feature in FEATURES} == {f.name for f in dataclasses.fields(Needs)}
    defines = {define for feature in FEATURES for define in feature.defines}
    assert defines == set(pack_surfaces(scene, Needs.of(scene)).defines)


@pytest.mark.parametrize("feature", FEATURES, ids=lambda feature: feature.field)
def test_the_full_program_is_fuller(feature):
    """Filling in a feature switches its define on: else full and lean would be one program."""
    scene = bare_scene(TRIANGLES, ambient=(0.0,) * 3)
    needs, filled = Needs.of(scene), feature.fill(scene)
    assert feature.missing(needs)
    lean = pack_surfaces(scene, needs).defines
    full = pack_surfaces(filled, full_needs(filled, feature.field)).defines
    assert all(full[define] > lean[define] for define in feature.defines)
    assert all(full[define] >= lean[define] for define in full)


@pytest.mark.kernels
def test_pictures_are_identical_without_what_is_left_out(plain):
    device = open_device(threads=1)
    bvh = build_bvh(plain.triangles)
    made = left_out(plain, bvh, device, views=16, pixels=16, repeats=1)
    assert all(set(row) == set(COLUMNS) for row in made)
    found = {row["feature"]: row for row in made}
    assert set(found) == {f.field for f in FEATURES} - {"directional_lights"} | {
        "frames", "planes", "lens_blocks", "triangles", "dark_lights",
    }  # fmt: skip
    assert [name for name, row in found.items() if not row["identical"]] == []
    assert found["vertex_colours"]["bytes_saved"] >= 4 * 9 * len(plain.triangles)
    assert found["triangles"]["what"].startswith("1 of 3 triangles")
    assert all(row["bytes_saved"] >= 0 for row in made)


def test_a_picture_loads_no_video_library_and_none_that_filters_textures():
    program = f"""if True:
        import sys, lfcore
        scene = lfcore.Scene.from_triangles({TRIANGLES.tolist()})
        assert lfcore.render(scene, pixels=16, views=2, filter="nearest").any()
        print({{"av", "cv2"}} & set(sys.modules))
        """
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert done.stdout == "set()\n", done.stderr


def test_what_differs_is_not_called_identical():
    zero, one = np.zeros(3), np.array([0.0, 0.0, 1e-30])
    assert same([zero], [zero.copy()])
    assert not same([zero], [one]) and not same([zero], [zero, zero])


def test_a_row_that_differs_is_an_error():
    rows = [{"scene": "s", "feature": name, "identical": name != "fog"} for name in ("a", "fog")]
    check_identical(rows[:1])
    with pytest.raises(LeftOutError, match="s, fog"):
        check_identical(rows)
