"""Pins: exact, the same everywhere, and enough for what pyproject.toml asks."""

from __future__ import annotations

import re
import tomllib

import yaml

from workflow.pins import DEVELOPMENT, ROOT, canonical


def pins(lines):
    found = (re.fullmatch(r"([A-Za-z0-9._-]+)==(\S+)", line.strip()) for line in lines)
    return {canonical(match[1]): match[2] for match in found if match}


def constraints():
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    assert not [line for line in lines if "://" in line or line.startswith("-")]
    return pins(lines)


def required():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    everything = project["dependencies"] + extras["workflow"] + extras["dev"]
    return {canonical(re.match(r"[A-Za-z0-9._-]+", text)[0]) for text in everything}


def test_all_that_is_required_is_pinned():
    assert required() <= set(constraints())


def test_conda_has_the_same_pins():
    environment = yaml.safe_load((ROOT / "workflow" / "envs" / "lfcore.yaml").read_text())
    conda = pins(environment["dependencies"][-1]["pip"])
    expected = constraints()
    assert {name: expected[name] for name in conda} == conda
    assert set(expected) - set(conda) <= DEVELOPMENT | {"flit-core"}
