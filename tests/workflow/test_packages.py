"""Exact versions and the rules' conda environment keep to the ranges of pyproject.toml."""

import tomllib

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

from robustness.outcome import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
EXTRAS = PROJECT["optional-dependencies"]
CONDA_NAMES = {
    "opencv-contrib-python-headless": "py-opencv",
    "openexr": "openexr-python",
    "matplotlib": "matplotlib-base",
}
"""Names in conda-forge that differ from the package index's."""


def ranges(lines):
    """Name -> range of each requirement."""
    found = [Requirement(line) for line in lines]
    return {canonicalize_name(one.name): one.specifier for one in found}


def pins():
    text = (ROOT / "constraints.txt").read_text(encoding="utf-8")
    return ranges(line for line in text.splitlines() if not line.startswith("#"))


@pytest.mark.parametrize("extra", ["", *EXTRAS])
def test_every_package_is_pinned_within_its_range(extra):
    pinned = pins()
    for name, asked in ranges(EXTRAS[extra] if extra else PROJECT["dependencies"]).items():
        (exact,) = pinned[name]
        assert exact.operator == "==" and exact.version in asked, name


def test_constraints_name_no_index():
    assert "://" not in (ROOT / "constraints.txt").read_text(encoding="utf-8")


def test_the_rules_environment_has_the_librarys_and_the_reports_packages():
    environment = yaml.safe_load((ROOT / "workflow/envs/lfcore.yaml").read_text(encoding="utf-8"))
    *conda, wheels = environment["dependencies"]
    found = {name: SpecifierSet(rest) for name, _, rest in (one.partition(" ") for one in conda)}
    found |= ranges(wheels["pip"])
    needed = ranges(PROJECT["dependencies"] + EXTRAS["workflow"])
    del needed["snakemake"]  # it enters a rule's environment by itself
    expected = {CONDA_NAMES.get(name, name): asked for name, asked in needed.items()}
    assert found == expected | {"python": SpecifierSet(">=3.11"), "pip": SpecifierSet()}
