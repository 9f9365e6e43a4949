"""Arrays and numbers of public objects that do not fit each other are refused in one line."""

import math
from dataclasses import replace

import numpy as np
import pytest
from plain_scenes import refused, scene, wall

from lfcore import BakedLight, Light, Material, Motion, Scene, Surface

GRIDS = np.array([[0, 0, 2], [6, 6, 1]], np.int32)
VALUES = np.ones((9, 3), np.float32)


@pytest.fixture
def plain():
    return scene(wall(2.0))


def test_light_on_grids(plain):
    held = BakedLight(GRIDS, VALUES)
    assert replace(plain, light=held).light is held
    for grids, words in (
        (GRIDS + [0, 0, 10_000_000], "grid outside the 9 points"),
        (GRIDS + [0, 1, 0], "grid outside"),
        (GRIDS - [1, 0, 0], "grid outside"),
        (GRIDS * [1, 1, 0], "grid outside"),
        (np.array([[k, k, 1] for k in range(6)]), "overlap"),
        (GRIDS.astype(float), r"integers of shape \(any, 3\), not float64"),
        (GRIDS[:, :2], "not int32"),
        ([[0, 0, 1]], "not a list"),
    ):
        refused(f"grids: .*{words}", BakedLight, grids, VALUES)
    refused("values: ", BakedLight, GRIDS, VALUES[:, 0])
    refused(
        r"light.grids: .*\(2, 3\), not int32", replace, plain, light=BakedLight(GRIDS[:1], VALUES)
    )
    refused("light: must be a BakedLight", replace, plain, light=VALUES)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"triangles": wall(2.0)[:, :2]}, r"triangles: .*\(any, 3, 3\), not float32"),
        ({"triangles": wall(np.nan)}, "triangles: are not finite"),
        ({"normals": np.full((2, 3, 3), np.nan)}, "normals: are not finite"),
        ({"triangles": "wall"}, "triangles: .*not a str"),
        ({"normals": wall(1.0)[:1]}, r"normals: .*\(2, 3, 3\)"),
        ({"uvs": wall(1.0)}, r"uvs: .*\(2, 3, 2\)"),
        ({"material_ids": np.array([0, 1])}, "material_ids: must be whole .*to 0, not 0 to 1"),
        ({"material_ids": np.array([0, -1])}, "material_ids: must be whole"),
        ({"material_ids": np.array([0.0, 0.0])}, "material_ids: .*float64"),
        ({"material_ids": np.array([0])}, "material_ids: "),
        ({"materials": []}, "material_ids: "),
        ({"materials": [Material("a", texture=0)]}, r"materials\[0\].texture: .*not 0 to 0"),
        ({"materials": [Material("a", normal_texture=1.5)]}, "normal_texture: .*not 1.5"),
        ({"materials": [Material("a", ior=0.5)]}, r"materials\[0\].ior: .* from 1 to .*not 0.5"),
        ({"materials": [Material("a", opacity=1.5)]}, "opacity: .* from 0 to 1, not 1.5"),
        ({"materials": [Material("a", clearcoat=math.nan)]}, "clearcoat: .*not nan"),
        ({"materials": [Material("a", attenuation_distance_m=-1)]}, "distance_m: .*not -1"),
        ({"materials": [Material("a", attenuation_colour=(1, 2, 0))]}, "colour: .*not 2"),
        ({"materials": [Material("a", diffuse=(1, 2))]}, r"materials\[0\].diffuse: must be three"),
        ({"materials": ["grey"]}, r"materials\[0\]: must be a Material"),
        ({"textures": [np.zeros((4, 4, 3), np.float32)]}, r"textures\[0\]: .*uint8"),
        ({"textures": [np.zeros((4, 4), np.uint8)]}, r"textures\[0\]: "),
        ({"textures": [np.zeros((0, 4, 3), np.uint8)]}, r"textures\[0\]: has no texels"),
        ({"lights": [Light(0, (0, 0), (1, 1, 1))]}, r"lights\[0\].vector: must be three"),
        ({"lights": ["sun"]}, r"lights\[0\]: must be a Light"),
        ({"ambient": 0.1}, "ambient: must be three numbers"),
        ({"sky": np.zeros((4, 5, 3), np.float32)}, "sky: "),
        ({"floor": 3}, "floor: must be a Material"),
        ({"motions": (Motion(1, 2, np.eye(4), np.eye(4)),)}, r"motions\[0\]: .*0 to 2, not 1 to 3"),
        ({"camera": "wide"}, "camera: must be a Camera"),
    ],
)
def test_fields_of_a_scene(plain, change, words):
    refused(words, replace, plain, **change)


def test_surfaces_motions_and_triangles():
    refused("texture: .*uint8", Surface, texture=np.zeros((4, 4, 3)))
    refused("diffuse: must be three", Surface, diffuse=0.5)
    refused(r"end: .*\(4, 4\)", Motion, 0, 1, np.eye(4), np.eye(3))
    corners = np.eye(3)[None]
    for given, words in (
        ({"camera": "wide"}, "camera: must be a Camera"),
        ({"lights": [1]}, "must be a Light"),
        ({"ambient": (1,)}, "ambient: "),
        ({"surface": "red"}, "surface: must be a Surface"),
        ({"colours": np.full((1, 3, 3), np.nan)}, "colours of corners: "),
    ):
        refused(words, Scene.from_triangles, corners, **given)
