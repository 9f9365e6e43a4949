"""What is left out changes nothing, and every feature has its place in the registry."""

import dataclasses

import numpy as np
import pytest

from lfcore.evaluation.left_out import COLUMNS, FEATURES, full_needs, left_out, same
from lfcore.evaluation.stability.subject import bare_scene
from lfcore.opencl.device import open_device
from lfcore.scene.model import DIRECTIONAL, Light, Material
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.surfaces import pack_surfaces

TRIANGLES = [[[-1, -1, 2], [1, -1, 2.5], [0, 1, 2]], [[-2, -2, 4], [2, -2, 4], [0, 2, 4]]]


@pytest.fixture(scope="module")
def plain():
    """A scene that needs nothing but one shadow."""
    light = Light(DIRECTIONAL, (0.0, -0.6, -0.8), (1.0, 1.0, 1.0))
    return bare_scene(TRIANGLES, lights=[light], materials=[Material("grey")])


def test_every_feature_has_its_place():
    """A new field of Needs, or a new define, fails here until the registry says what it saves."""
    scene = bare_scene(TRIANGLES)
    assert {feature.field for feature in FEATURES} == {f.name for f in dataclasses.fields(Needs)}
    defines = {define for feature in FEATURES for define in feature.defines}
    assert defines == set(pack_surfaces(scene, Needs.of(scene)).defines)


@pytest.mark.parametrize("feature", [f for f in FEATURES if f.fill], ids=lambda f: f.field)
def test_the_full_program_is_fuller(feature):
    """Filling in a feature switches its define on: else full and lean would be one program."""
    scene = bare_scene(TRIANGLES)
    needs, filled = Needs.of(scene), feature.fill(scene)
    assert feature.missing(needs)
    lean = pack_surfaces(scene, needs).defines
    full = pack_surfaces(filled, full_needs(needs, filled, feature.field)).defines
    assert any(full[define] > lean[define] for define in feature.defines)


def test_pictures_are_identical_without_what_is_left_out(plain):
    device = open_device(threads=1)
    rows = left_out(plain, build_bvh(plain.triangles), device, views=16, pixels=16, repeats=1)
    assert all(set(row) == set(COLUMNS) for row in rows)
    found = {row["feature"]: row for row in rows}
    needed = {"shadows", "directional_lights"}
    assert set(found) == {f.field for f in FEATURES if f.fill} - needed | {
        "frames", "planes", "lens_blocks",
    }  # fmt: skip
    assert [name for name, row in found.items() if not row["identical"]] == []
    assert found["vertex_colours"]["bytes_saved"] == 4 * 9 * len(TRIANGLES)


def test_what_differs_is_not_called_identical():
    zero, one = np.zeros(3), np.array([0.0, 0.0, 1e-30])
    assert same([zero], [zero.copy()])
    assert not same([zero], [one]) and not same([zero], [zero, zero])
