"""Configurations that name a run, and those that are refused with the key's name."""

from __future__ import annotations

import jsonschema
import pytest
import yaml

from workflow.settings import SettingsError, check_settings, read_schema
from workflow.sweep import ROOT, merged, nested, read_sweep

CONFIG = ROOT / "config"


def load(name):
    return yaml.safe_load((CONFIG / name).read_text())


def test_the_schema_is_one():
    jsonschema.Draft202012Validator.check_schema(read_schema())


@pytest.mark.parametrize("name", ["config.yaml", "thesis.yaml", "smoke.yaml"])
def test_the_configurations_of_the_project(name):
    settings = check_settings(merged(load("config.yaml"), load(name)))
    assert settings["scenes"] == ["bike", "cabin", "bedroom"]
    expected = {"config.yaml": 128, "thesis.yaml": 512, "smoke.yaml": 32}
    assert settings["spatial_resolution"] == expected[name]
    assert max(settings["angular_resolutions"]) == (64 if name == "smoke.yaml" else 512)


@pytest.mark.parametrize("path", sorted((CONFIG / "sweeps").glob("*.tsv")), ids=lambda p: p.stem)
def test_the_sweeps_of_the_project(path):
    cases = read_sweep(path)
    assert len(cases) > 1
    for overrides in cases.values():
        check_settings(merged(load("config.yaml"), nested(overrides)))


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
        ({"planes": [{"focus_distance_m": 2}] * 101}, "planes"),
        ({"planes": [{"f_number": 2}]}, r"planes\.0.*focus_distance_m"),
        ({"planes": [{"focus_distance_m": -1}]}, r"planes\.0\.focus_distance_m"),
        ({"planes": [{"focus_distance_m": 1, "colour": 1}]}, r"planes\.0\.colour: unknown key"),
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
        "planes": [{"focus_distance_m": "2.5", "keep_magnification": "true"}],
        "figures": {"make": [], "aperture_stops": ["0", "1.5"]},
    }
    settings = check_settings(given)
    assert settings["angular_resolutions"] == [16, 32] and settings["store"] is False
    assert settings["encoder"]["crf"] == 18.5 and settings["encoder"]["preset"] is None
    assert settings["layout"]["pack"] == 2
    assert settings["planes"] == [{"focus_distance_m": 2.5, "keep_magnification": True}]
    assert settings["figures"]["aperture_stops"] == [0, 1.5]
    assert given["store"] == "false"


def test_no_scene_at_all():
    with pytest.raises(SettingsError, match="'scenes' is a required property"):
        check_settings({})


def test_a_hundred_planes_are_admitted():
    planes = [{"focus_distance_m": 1 + i / 10} for i in range(100)]
    assert check_settings({"scenes": ["bike"], "planes": planes})["planes"] == planes


def test_sweeps_say_what_is_wrong(tmp_path):
    path = tmp_path / "s.tsv"
    path.write_text("name\tcrf\na\t1\n")
    with pytest.raises(SettingsError, match="column 'case'"):
        read_sweep(path)
    path.write_text("case\tencoder.crf\na\t1\na\t2\n")
    with pytest.raises(SettingsError, match="two cases are called 'a'"):
        read_sweep(path)
    with pytest.raises(SettingsError, match="cannot be read"):
        read_sweep(tmp_path / "absent.tsv")
