"""Pins: exact, the same everywhere, and enough for what pyproject.toml asks."""

import re
import tomllib

import yaml

from workflow.pins import CONDA_NAMES, ROOT, canonical, conda_environment, name_of, needed_by_rules


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
    return {name_of(one) for one in project["dependencies"] + extras["workflow"] + extras["dev"]}


def test_all_that_is_required_is_pinned():
    assert required() <= set(constraints())


def test_rules_have_the_ranges_of_the_project_and_no_snakemake():
    *conda, wheels = yaml.safe_load(conda_environment())["dependencies"]
    names = {name_of(one) for one in conda} | {name_of(one) for one in wheels["pip"]}
    assert "snakemake" not in names
    expected = {CONDA_NAMES.get(name_of(one)) or name_of(one) for one in needed_by_rules()}
    assert expected | {"python", "pip"} == names
    # Wheels that not every platform has say so.
    intel = [one for one in wheels["pip"] if one.startswith("intel")]
    assert len(intel) == 2 and all("platform_machine in 'x86_64 AMD64'" in one for one in intel)
