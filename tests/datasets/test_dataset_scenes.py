"""Descriptions that are refused, and scenes that depend on seed and index alone."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_scenes import refused

import lfcore
from lfcore.datasets.batches import make_batch
from lfcore.datasets.card import RECORDS, tables, write_report
from lfcore.datasets.description import Description
from lfcore.datasets.looks import BACKDROP
from lfcore.datasets.sample import lens_of, sample
from lfcore.scene.files import scene_digest
from lfcore.scene.procedural import vessels
from lfcore.scene.surface_mesh import Surface

CONFIG = Path(__file__).resolve().parents[2] / "config/datasets"
PLAIN = {"name": "plain", "kind": "focal_stacks", "pixels": 32}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"pixles": 3}, "pixles: unknown key. Did you mean 'pixels'"),
        ({"placement": {"depth_m": [2, 1]}}, r"placement\.depth_m.*2 is above 1"),
        ({"placement": {"depth_m": [0, 1, "log"]}}, r"placement\.depth_m"),
        ({"placement": {"depth_m": [3, 4]}}, r"placement\.depth_m"),
        ({"lens": {"focus_m": [0.001]}}, r"^lens\.focus_m: nearer than the lens can focus"),
        ({"scenes": {"train": 0, "validation": 0}}, "^scenes: there are none"),
        ({"lens": {"f_number": 0}}, r"lens\.f_number"),
        ({"shapes": {"builders": ["unicorn"]}}, r"shapes\.builders"),
        ({"shapes": {"builders": []}}, "neither meshes nor builders"),
        ({"name": "../up"}, "name"),
        ({"quality_db": float("nan")}, "quality_db"),
        ({"kind": "holograms"}, "kind"),
        ({"sensor": {"read_noise_e": -1}}, "sensor: .*read_noise_e: must be a number from 0"),
        ({"sensor": {"bits": 0}}, "sensor: .*bits: must be a whole number from 1 to 16"),
        ({"pixels": 8}, "pixels: .*each side must be from 16 to 4096"),
        ({"pixels": "64x47"}, "pixels: .*width and height must differ by an even number"),
        ({"pixels": "wide"}, "pixels: .*must be a whole number"),
        (
            {"kind": "infinigen_defocus", "lens": {"focus_m": [0.11, 0.12]}},
            "names have one decimal",
        ),
        ({"codes": "raw16"}, "codes: raw ones need a sensor"),
    ],
)
def test_what_is_refused_names_its_key(change, words):
    refused(words, lfcore.sample_scene, PLAIN | change, 0)


def test_defaults_that_are_written_down_change_nothing():
    plain = Description.check(PLAIN)
    written = Description.check(json.loads(json.dumps(plain.model_dump())))
    assert repr(written.of_scenes()) == repr(plain.of_scenes())
    assert written.digest("") == plain.digest("")


def test_folders_and_disks_that_do_not_do(tmp_path):
    for key, value in (("meshes", str(tmp_path)), ("meshes", [str(tmp_path / "none.ply")])):
        refused(f"shapes.{key}", lfcore.sample_scene, PLAIN | {"shapes": {key: value}}, 0)
    great = Description.check(PLAIN | {"pixels": 4096, "scenes": {"train": 10**7}})
    refused("and the disk has", great.check_room, tmp_path)
    (tmp_path / "a.yaml").write_text("seed: 1\n")
    refused(r"a\.yaml.*dataset", lfcore.sample_scene, tmp_path / "a.yaml", 0)


@pytest.mark.slow
@pytest.mark.parametrize("file", sorted(CONFIG.iterdir()), ids=lambda file: file.stem)
def test_the_descriptions_of_the_project(file):
    description = Description.read(file)
    assert description.name == file.stem
    scene = lfcore.sample_scene(file, 1)
    assert scene.triangle_count > 100 and scene.name.endswith("000001")


def test_splits_and_batches_cover_every_scene_once():
    of = Description.check(PLAIN | {"scenes": {"train": 70, "validation": 5, "test": 2}})
    batches = [of.scenes_of(name) for name in of.batches()]
    assert [index for batch in batches for index in batch] == list(range(77))
    assert [of.split(index) for index in (0, 69, 70, 74, 75, 76)] == [
        "train", "train", "validation", "validation", "test", "test",
    ]  # fmt: skip


@settings(max_examples=4)
@given(st.lists(st.integers(0, 10**6), min_size=2, max_size=4, unique=True), st.randoms())
def test_a_scene_depends_on_seed_and_index_alone(indices, random):
    of = Description.check(PLAIN | {"seed": 7, "shapes": {"builders": ["ball", "book", "vase"]}})
    first = {index: scene_digest(lfcore.sample_scene(of, index)) for index in indices}
    random.shuffle(indices)
    for index in indices:
        assert scene_digest(lfcore.sample_scene(of.model_dump(), index)) == first[index]
    others = Description.check(PLAIN | {"seed": 8, "shapes": of.shapes})
    a, b = (lfcore.sample_scene(one, indices[0]).triangles for one in (of, others))
    assert a.shape != b.shape or not np.array_equal(a, b)


@pytest.mark.parametrize("share_resting", [0, 1])
def test_objects_are_apart_before_the_wall_and_on_the_floor(share_resting):
    of = Description.check(PLAIN | {
        "shapes": {"builders": ["ball", "vase", "book"]}, "materials": {"share_textured": 0},
        "placement": {"share_resting": share_resting, "objects": 20},
    })  # fmt: skip
    for index in range(6):
        scene, names, *_ = sample(of, index)
        assert len(names) >= 5
        kinds = np.array([m.name for m in scene.materials])[scene.material_ids]
        behind = np.isin(kinds, BACKDROP)
        objects = scene.triangles[~behind].reshape(-1, 3)
        wall = scene.triangles[kinds == "wall"].reshape(-1, 3)
        assert objects[:, 2].min() > of.placement.depth_m[0] / 2
        assert ("floor" in kinds) == bool(share_resting)
        if share_resting:
            floor = scene.triangles[kinds == "floor"][0].astype(float)
            normal = np.cross(floor[1] - floor[0], floor[2] - floor[0])
            normal *= -np.sign(normal[1]) / np.linalg.norm(normal)  # upwards: y is down
            heights = (objects - floor[0]) @ normal
            assert -1e-5 < heights.min() < 1e-3
        else:
            assert objects[:, 2].max() <= wall[:, 2].min() + 1e-4


@pytest.mark.parametrize("kind", ["sun", "point", "spot"])
def test_lamps_shine_from_above_on_the_middle_of_the_scene(kind):
    of = PLAIN | {
        "lights": {"kinds": [kind], "strength": 1, "share_sky": 0},
        "placement": {"share_resting": 0},
    }
    for index in range(4):
        scene, *_ = sample(of, index)
        assert not scene.bake
        for light in scene.lights:
            assert light.is_spot == (kind == "spot")
            if kind != "sun":
                away = np.linalg.norm(light.vector)
                assert light.vector[1] < 0 and abs(away - light.reference_distance_m) < 3
            if light.is_spot:
                assert np.dot(light.normal, light.vector) < 0
        assert sum(light.colour[1] for light in scene.lights) == pytest.approx(0.93)


def test_the_lens_of_an_item_is_drawn_and_changes_no_scene():
    ranges = {"f_number": [1.4, 4, "log"], "focal_length_mm": [2, 3], "random_focus": 4}
    of = Description.check(PLAIN | {"lens": ranges})
    lenses = [lens_of(of, index) for index in range(20)]
    assert len({lens.camera.f_number for lens in lenses}) == 20
    for camera, focus_m in lenses:
        assert 1.4 <= camera.f_number <= 4 and 0.002 <= camera.focal_length_m <= 0.003
        assert len(focus_m) == 4 and sorted(focus_m) == list(focus_m)
        assert 0.1 <= focus_m[0] and focus_m[-1] <= 1.5
    drawn = lfcore.sample_scene(PLAIN | {"lens": {"f_number": [1.4, 4]}}, 3)
    fixed = lfcore.sample_scene(PLAIN, 3)
    assert np.array_equal(drawn.triangles, fixed.triangles)
    assert (
        drawn.camera.f_number
        == lens_of(Description.check(PLAIN | {"lens": {"f_number": [1.4, 4]}}), 3).camera.f_number
    )


def test_a_sky_takes_the_place_of_ambient_light():
    scene, *_ = sample(PLAIN | {"lights": {"share_sky": 1}}, 0)
    assert scene.bake is not None and scene.sky.min() > 0


def test_the_licence_of_a_mesh_is_beside_it(tmp_path):
    of = Description.check(PLAIN | {"shapes": {"licence": "CC0", "meshes": str(tmp_path)}})
    (tmp_path / "b.ply.license").write_text("CC-BY-4.0\nhttps://example.org\n")
    assert of.licence_of(tmp_path / "a.ply") == "CC0"
    assert of.licence_of(tmp_path / "b.ply") == "CC-BY-4.0 https://example.org"


def test_users_meshes_and_textures(tmp_path):
    trimesh.creation.icosahedron().export(tmp_path / "mine.ply")
    lfcore.write_picture(tmp_path / "mine.png", np.full((8, 8, 3), 200, np.uint8))
    shapes = {"meshes": str(tmp_path), "builders": []}
    more = {"shapes": shapes, "materials": {"textures": str(tmp_path), "share_textured": 1}}
    scene, names, *_ = sample(PLAIN | more, 3)
    assert set(names) == {"mine.ply"} and len(scene.textures) == 1
    assert scene.textures[0].shape == (8, 8, 3)


@pytest.mark.kernels
def test_the_page_of_light_fields_has_their_pictures(device, tmp_path):
    of = Description.check({
        "name": "small", "kind": "light_fields", "pixels": 40, "quality_db": 20, "also": [],
        "scenes": {"train": 1, "validation": 0},
        "lens": {"focal_length_mm": 100, "sensor_width_mm": 100, "focus_m": [1.6], "views": 3},
        "placement": {"depth_m": [1.1, 2.8], "wall_m": 3},
    })  # fmt: skip
    shard = tmp_path / "shard.tar"
    records = make_batch(of, [0], shard, tmp_path / "records", tmp_path / "drafts", device)
    made = tables(of, records, tmp_path)
    files = {name: tmp_path / f"{name}.csv" for name in ("refused", "sources")}
    for name, file in files.items():
        made[name].to_csv(file, index=False)
    page = tmp_path / "index.html"
    (tmp_path / "data").mkdir()
    (tmp_path / "data/an_item.png").write_bytes(b"of this run")
    write_report(page, of, records, [shard], files, {})
    assert page.read_text().count("data:image/png") == 2
    assert "an_item" not in page.read_text()
    assert all(list(made[name]) == list(columns) for name, columns in RECORDS.items())
    (seconds,) = made["seconds"].to_dict("records")
    parts = seconds["scene_core_seconds"] + seconds["files_core_seconds"]
    assert 0 < parts < seconds["core_seconds"]


def test_splits_by_mesh_share_no_file(tmp_path):
    for number in range(40):
        trimesh.creation.box().export(tmp_path / f"{number}.ply")
    keys = {"shapes": {"meshes": str(tmp_path), "builders": []}, "split_by": "mesh"}
    of = Description.check(PLAIN | keys | {"scenes": {"train": 6, "validation": 2, "test": 2}})
    used = {}
    for index in range(of.count):
        used.setdefault(of.split(index), set()).update(sample(of, index).objects)
    assert len(used["train"]) > 15 and used["validation"] and used["test"]
    assert not used["train"] & used["validation"] and not used["validation"] & used["test"]
    one = Description.check(PLAIN | keys | {"shapes": {"meshes": [str(tmp_path / "1.ply")]}})
    only = {one.split(i) for i in (0, 499)} - {s for s in ("train", "validation") if _has(one, s)}
    assert len(only) == 1
    assert Description.check(PLAIN).digest("") != Description.check(PLAIN | keys).digest("")


def _has(of, split):
    try:
        return bool(of.of_split(of.mesh_files(), split))
    except lfcore.SettingsError as error:
        assert "none of 1 files is in the split" in str(error)
        return False


def test_furniture_varies_in_colour():
    of = PLAIN | {"shapes": {"builders": ["armchair"]}, "materials": {"share_redressed": 0}}
    looks = [
        tuple(m.diffuse for m in sample(of | {"placement": {"objects": 1}}, index).scene.materials)
        for index in range(3)
    ]
    assert len(set(looks)) == 3


def materials(keys, count):
    """The materials of the first scenes of a description, by name."""
    found = {}
    for index in range(count):
        for material in sample(PLAIN | keys, index).scene.materials:
            found.setdefault(material.name, []).append(material)
    return found


def test_things_are_of_glass_metal_and_varnish_by_their_shares():
    few = {"placement": {"objects": 6}, "shapes": {"builders": ["goblet", "pan", "block"]}}
    keys = {"share_glass": 0.15, "share_metal": 0.15, "share_coated": 0.5}
    drawn = materials(few | {"materials": keys}, 20)
    of_glass, of_metal, coated = (
        {name: np.mean([has(m) for m in drawn[name]]) for name in ("goblet", "pan", "block")}
        for has in (lambda m: m.transmission == 1, lambda m: m.metallic == 1,
                    lambda m: m.clearcoat == 1)
    )  # fmt: skip
    assert of_glass["goblet"] > 0.7 > 0.4 > of_glass["block"] > 0 and of_metal["pan"] > 0.7
    assert 0.2 < coated["block"] < 0.6
    mirrors = [m.roughness == 0 for m in drawn["pan"] if m.metallic == 1]
    assert 0.2 < np.mean(mirrors) < 0.8
    none = materials(few | {"materials": dict.fromkeys(keys, 0)}, 4)
    every = [material for group in none.values() for material in group]
    assert not any(m.transmission or m.metallic > 0 or m.clearcoat for m in every)


@pytest.mark.slow
@pytest.mark.parametrize("share", [0, 1])
def test_rooms_have_panes_and_mirrors_by_their_shares(share):
    keys = {"share_panes": share, "share_mirrors": share}
    drawn = materials({"placement": {"share_rooms": 1}, "materials": keys}, 3)
    assert ("pane" in drawn) == ("mirror" in drawn) == bool(share)
    assert ("print" in drawn) != bool(share)
    assert all(m.transmission == 1 and m.thin_walled for m in drawn.get("pane", ()))
    assert all(m.metallic == 1 and not m.roughness for m in drawn.get("mirror", ()))


def test_glass_of_users_meshes_has_no_volume_and_that_of_vessels_is_closed(tmp_path):
    trimesh.creation.icosahedron().export(tmp_path / "mine.ply")
    glass = {"share_glass": 1, "share_metal": 0}
    users = {"meshes": str(tmp_path), "builders": []}
    (mine,) = {
        m.thin_walled for m in materials({"shapes": users, "materials": glass}, 1)["mine.ply"]
    }
    assert mine
    for name in vessels.PROFILES:
        of = PLAIN | {"shapes": {"builders": [name]}, "materials": glass}
        assert not any(m.thin_walled for m in sample(of, 0).scene.materials)
        corners = vessels.vessel(name, Surface())[0].triangles
        mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        mesh.merge_vertices(digits_vertex=7)
        assert mesh.is_watertight and mesh.volume > 0
