"""Configurations that name a run, and those that are refused with the key's name."""

from __future__ import annotations

from pathlib import Path

import jsonschema
import pytest
import yaml

from lfcore.errors import SettingsError
from lfcore.workflow import settings as documents
from lfcore.workflow.settings import check_settings
from lfcore.workflow.sweep import merged

ROOT = Path(__file__).resolve().parents[2]
CONFIG = ROOT / "config"


def load(name):
    return yaml.safe_load((CONFIG / name).read_text())


def test_schema_defaults_and_table_are_those_of_the_keys():
    """Else: `make settings`."""
    for path, text in documents.documents(ROOT).items():
        assert path.read_text(encoding="utf-8") == text, path


def test_the_schema_is_one_and_admits_what_the_keys_admit():
    schema = load("../workflow/schemas/config.schema.yaml")
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    assert validator.is_valid(load("config.yaml"))
    assert not validator.is_valid(load("config.yaml") | {"spatial_resolution": 15})
    assert not validator.is_valid(load("config.yaml") | {"colour": 1})


def test_every_key_says_what_it_means():
    text = (CONFIG / "README.md").read_text(encoding="utf-8")
    for name, key in documents.leaves(documents.schema()):
        assert key["description"] and f"| `{name}` | {key['description']} |" in text, name


@pytest.mark.parametrize("name", ["config.yaml", "thesis.yaml", "smoke.yaml", "micro.yaml"])
def test_the_configurations_of_the_project(name):
    settings = check_settings(merged(load("config.yaml"), load(name)))
    scenes = ["chart"] if name == "micro.yaml" else ["bike", "cabin", "bedroom"]
    assert settings["scenes"] == scenes
    expected = {"config.yaml": 128, "thesis.yaml": 512, "smoke.yaml": 32, "micro.yaml": 16}
    assert settings["spatial_resolution"] == expected[name]
    largest = {"smoke.yaml": 64, "micro.yaml": 4}
    assert max(settings["angular_resolutions"]) == largest.get(name, 512)


def test_defaults_are_those_of_the_default_configuration():
    assert check_settings({"scenes": ["bike", "cabin", "bedroom"]}) == load("config.yaml")


def test_what_is_given_is_not_changed():
    config = {"scenes": ["bike"], "layout": {"kind": "views"}}
    settings = check_settings(config)
    assert config == {"scenes": ["bike"], "layout": {"kind": "views"}}
    assert settings["layout"] == {"kind": "views", "order": "serpentine", "pack": "auto"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"spatial_resolutoin": 64}, "spatial_resolutoin: unknown key.*'spatial_resolution'"),
        ({"encoder": {"crff": 3}}, r"encoder\.crff: unknown key.*'crf'"),
        ({"spatial_resolution": 0}, "spatial_resolution: 0 is less than"),
        ({"spatial_resolution": 15}, "spatial_resolution.*16 to 8192"),
        ({"spatial_resolution": 33.5}, "spatial_resolution"),
        ({"spatial_resolution": "many"}, "spatial_resolution"),
        ({"angular_resolutions": [16, 0]}, r"angular_resolutions\.1: 0 is less than"),
        ({"angular_resolutions": [16, 2048]}, r"angular_resolutions\.1: 2048 is greater"),
        ({"angular_resolutions": []}, "angular_resolutions"),
        ({"angular_resolutions": [16, 16]}, "angular_resolutions"),
        ({"scenes": []}, "scenes"),
        ({"store": "maybe"}, "store"),
        ({"layout": {"kind": "both"}}, r"layout\.kind.*macropixels"),
        ({"layout": {"pack": 0}}, r"layout\.pack"),
        ({"encoder": {"crf": 64}}, r"encoder\.crf: 64 is greater"),
        ({"encoder": {"codec": "mpeg2"}}, r"encoder\.codec"),
        ({"tile_mib": 0}, "tile_mib"),
        ({"picture_format": "jpeg"}, "picture_format.*png or ppm"),
        ({"planes": []}, "planes"),
        ({"planes": [{"focus_m": 2}] * 101}, "planes"),
        ({"planes": [{"f_number": 2}]}, r"planes\.0.*focus_m"),
        ({"planes": [{"focus_m": -1}]}, r"planes\.0\.focus_m"),
        ({"planes": [{"focus_m": 1, "colour": 1}]}, r"planes\.0\.colour: unknown key"),
        ({"figures": {"make": ["portrait"]}}, r"figures\.make\.0"),
    ],
    ids=lambda value: None if isinstance(value, str) else str(value)[:40],
)
def test_impossible_settings_are_refused_by_name(change, words):
    with pytest.raises(SettingsError, match=words):
        check_settings(merged({"scenes": ["bike"]}, change))


def test_text_of_the_command_line_is_read_as_what_is_meant():
    given = {
        "scenes": ["bike"],
        "angular_resolutions": ["16", "32"],
        "store": "false",
        "encoder": {"crf": "18.5", "preset": "null"},
        "layout": {"pack": "2"},
        "planes": [{"focus_m": "2.5", "keep_magnification": "true"}],
        "figures": {"make": [], "aperture_stops": ["0", "1.5"]},
    }
    settings = check_settings(given)
    assert settings["angular_resolutions"] == [16, 32] and settings["store"] is False
    assert settings["encoder"]["crf"] == 18.5 and settings["encoder"]["preset"] is None
    assert settings["layout"]["pack"] == 2
    assert settings["planes"] == [{"focus_m": 2.5, "keep_magnification": True}]
    assert settings["figures"]["aperture_stops"] == [0, 1.5]
    assert given["store"] == "false"


def test_no_scene_at_all():
    with pytest.raises(SettingsError, match="'scenes' is a required property"):
        check_settings({})


def test_a_hundred_planes_are_admitted():
    planes = [{"focus_m": 1 + i / 10} for i in range(100)]
    assert check_settings({"scenes": ["bike"], "planes": planes})["planes"] == planes


def itself():
    value = {"kind": "views"}
    value["order"] = value
    return value


def deep():
    value = []
    for _ in range(3000):
        value = [value]
    return value


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({1: 2}, "configuration: 1: unknown key"),
        ({1: 2, "b": 3, None: 4}, "configuration: .*: unknown key"),
        ({"layout": {1: 2, "b": 3}}, r"configuration: layout\..*: unknown key"),
        ({"layout": itself()}, r"layout\.order: contains itself"),
        ({"scenes": deep()}, r"scenes\.0.*: is nested more than 32 deep"),
        ({"tile_mib": True}, "tile_mib: True is no number"),
        ({"tile_mib": float("nan")}, "tile_mib"),
        ({"spatial_resolution": 1e400}, "spatial_resolution"),
        ({"spatial_resolution": "9" * 5000}, "spatial_resolution"),
        ({"scenes": "bike"}, "scenes"),
        ({"encoder": 3}, "encoder"),
        ({"encoder": None}, "encoder"),
        ({"device": 1}, "device"),
        ({"sweep": ["a"]}, "sweep"),
        ({"layout": {"pack": "autoo"}}, r"layout\.pack"),
        ({"analysis": {"targets_db": [35, "x"]}}, r"analysis\.targets_db\.1: 'x'"),
        ({"planes": "scenes"}, "planes: 'scenes' is neither 'scene' nor a list"),
    ],
    ids=range(17),
)
def test_strange_configurations_are_one_line(change, words):
    with pytest.raises(SettingsError, match=words) as caught:
        check_settings({"scenes": ["bike"]} | change)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1000


def test_whole_numbers_may_be_written_with_a_point():
    assert check_settings({"scenes": ["a"], "tile_mib": 64.0})["tile_mib"] == 64
    with pytest.raises(SettingsError, match="tile_mib"):
        check_settings({"scenes": ["a"], "tile_mib": 64.5})
