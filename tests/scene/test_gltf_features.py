"""The glTF scene of the manual, which has every feature: what is found, said and seen."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from lfcore import Slab, Tracer
from lfcore.optics.bundles import macropixels
from lfcore.oracle.slab import all_pixels, trace
from lfcore.scene.build import build_scene
from lfcore.scene.needs import Needs
from lfcore.tracing.bvh import build_bvh

EXAMPLE = runpy.run_path(str(Path(__file__).parents[2] / "docs/examples/gltf_features.py"))
SAID = {
    "left out: animation 'bounce': the pose in the file",
    "left out: extension KHR_materials_clearcoat",
    "left out: material 'lamp': KHR_materials_clearcoat",
    "left out: material 'bumps': baked shadows",
    "approximated: material 'veil': transparency: cut out where it lets through most",
}


@pytest.fixture(scope="module")
def features(tmp_path_factory):
    path = tmp_path_factory.mktemp("gltf") / "features.glb"
    EXAMPLE["main"]([str(path)])
    return build_scene(path)


def test_everything_is_found_and_what_is_dropped_is_said(features):
    needs = Needs.of(features)
    assert needs.cut_outs and needs.physical and needs.spots and needs.vertex_colours
    assert (needs.point_lights, needs.directional_lights) == (2, 1) and not needs.emitters
    assert {f"{note.kind}: {note.what}" for note in features.notes} == SAID
    named = {material.name: material for material in features.materials}
    assert named["gold"].metallic == 1 and named["bands"].metal_texture >= 0
    assert named["bumps"].normal_scale == 0.8 and named["lamp"].emission == (1.5, 1.5, 1.5)
    assert named["leaf"].alpha_cutoff == named["veil"].alpha_cutoff == 0.5
    assert named["sign"].metallic < 0 and named["sign"].emission_texture >= 0
    assert features.camera.field_width == pytest.approx(2 * np.tan(0.31))
    assert features.dropped == {}


def test_it_looks_as_in_float64(features, device):
    """All but pixels at edges, and at highlights of a few of them."""
    slab = Slab(features.camera, 2, 12)
    pixels = all_pixels(slab)
    tracer = Tracer(features, build_bvh(features.triangles), device, mipmaps=False)
    found = tracer.bundle_radiance(macropixels(slab, pixels))
    expected = trace(features, slab, pixels).reshape(found.shape)
    difference = (np.abs(found - expected) / np.maximum(expected, 1)).max(-1)
    assert np.median(difference) < 1e-3 and (difference > 0.01).mean() < 0.01


def test_what_colours_of_vertices_lose_is_said(tmp_path):
    """Their alpha, where it would count, and all of them where a surface is unlit."""
    glb = EXAMPLE["Glb"]()
    faded = np.float32([[1, 0, 0, 1], [0, 1, 0, 0.5], [0, 0, 1, 1], [1, 1, 1, 1]])
    for entry in ({"name": "mist", "alphaMode": "BLEND"},
                  {"name": "sign", "extensions": {"KHR_materials_unlit": {}}},
                  {"name": "wall"}):  # fmt: skip
        glb.tree["materials"].append({**entry, "pbrMetallicRoughness": EXAMPLE["pbr"](0, 1)})
        glb.mesh((*EXAMPLE["square"](1, 1), faded), len(glb.tree["materials"]) - 1)
    glb.write(tmp_path / "colours.glb")
    notes = build_scene(tmp_path / "colours.glb").notes
    assert {note.what for note in notes if note.kind == "left out"} == {
        "material 'mist': alpha of vertices",
        "material 'sign': colours of vertices, which unlit surfaces do not take",
    }
