"""Configurations that name a run, and those that are refused with the key's name."""

from pathlib import Path

import jsonschema
import pytest
import yaml

from lfcore.errors import SettingsError
from lfcore.workflow.settings import check_settings, schema

CONFIG = Path(__file__).resolve().parents[2] / "config"


def load(name):
    return yaml.safe_load((CONFIG / name).read_text())


def complete():
    """The default configuration with its studies."""
    made = load("config.yaml")
    for file in (CONFIG / "studies").iterdir():
        made |= yaml.safe_load(file.read_text())
    return made


def test_the_files_of_the_project_hold_every_key_and_its_default():
    assert check_settings(complete()) == check_settings({})
    assert VALIDATOR.is_valid(complete())


@pytest.mark.parametrize("name", ["config.yaml", "thesis.yaml", "smoke.yaml", "micro.yaml"])
def test_the_configurations_of_the_project(name):
    settings = check_settings(complete() | load(name))
    scenes = ["chart_sky"] if name == "micro.yaml" else ["bike", "cabin", "bedroom"]
    assert settings["scenes"] == scenes
    expected = {"config.yaml": 128, "thesis.yaml": 512, "smoke.yaml": 32, "micro.yaml": 16}
    assert settings["pixels"] == expected[name]
    largest = {"smoke.yaml": 64, "micro.yaml": 4}
    assert max(settings["views"]) == largest.get(name, 512)


def test_what_is_given_is_not_changed():
    config = {"layout": {"kind": "views"}}
    settings = check_settings(config)
    assert config == {"layout": {"kind": "views"}}
    assert settings["layout"] == {"kind": "views", "order": "serpentine", "pack": None}


VALIDATOR = jsonschema.Draft202012Validator(schema())
REFUSED = [
    ({"pixles": 64}, "pixles"),
    ({"encoding": {"crff": 3}}, r"encoding\.crff"),
    ({"pixels": 0}, "pixels.*greater than or equal to 16"),
    ({"pixels": 33.5}, "pixels"),
    ({"pixels": "many"}, "pixels"),
    ({"pixels": "1920x"}, "pixels"),
    ({"pixels": float("inf")}, "pixels"),
    ({"views": [16, 0]}, r"views\.1"),
    ({"views": []}, "views"),
    ({"views": [16, 16]}, "views.*twice"),
    ({"scenes": []}, "scenes"),
    ({"scenes": "bike"}, "scenes"),
    ({"store": "maybe"}, "store"),
    ({"layout": {"kind": "both"}}, r"layout\.kind.*macropixels"),
    ({"layout": {"pack": 0}}, r"layout\.pack"),
    ({"encoding": {"crf": 64}}, r"encoding\.crf"),
    ({"encoding": {"codec": "mpeg2"}}, r"encoding\.codec"),
    ({"encoding": None}, "encoding"),
    ({"picture_format": "jpeg"}, "picture_format.*'png' or 'ppm'"),
    ({"planes": []}, "planes"),
    ({"planes": [{"focus_m": 2}] * 101}, "planes"),
    ({"planes": [{"f_number": 2}]}, r"planes.*0\.focus_m"),
    ({"planes": [{"focus_m": -1}]}, r"planes.*0\.focus_m"),
    ({"planes": [{"focus_m": 1, "colour": 1}]}, r"planes.*0\.colour"),
    ({"reports": ["portrait"]}, r"reports\.0"),
    ({"device": 1}, "device"),
    ({"analysis": {"chosen_rays": {"qualities_db": [35, "x"]}}}, r"qualities_db\.1: 'x'"),
]


@pytest.mark.parametrize(("change", "words"), REFUSED, ids=range(len(REFUSED)))
def test_impossible_settings_are_refused_in_one_line_that_names_the_key(change, words):
    """By the schema that Snakemake validates with, too."""
    with pytest.raises(SettingsError, match=words) as caught:
        check_settings(change)
    assert "\n" not in str(caught.value) and len(str(caught.value)) < 1000
    infinite = change == {"pixels": float("inf")}  # which JSON does not have
    assert infinite or not VALIDATOR.is_valid(change)
