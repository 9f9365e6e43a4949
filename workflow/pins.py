"""Write constraints.txt and the conda environment of the rules.

    python -m workflow.pins             (make pins; --check: whether either is stale)

constraints.txt has exact pins of what is installed now, without any address of an index.  The
environment has the ranges of pyproject.toml: packages of conda-forge where there are such, wheels
for the rest, and no Snakemake, which reaches into a rule's environment by itself.
"""

import importlib.metadata
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from lfcore.files import write_text

ROOT = Path(__file__).resolve().parents[1]
BUILD_BACKEND = "flit_core==4.2.0"
NOT_OURS = {"lfcore", "pip", "setuptools", "wheel", "flit-core"}

CONSTRAINTS_HEAD = """\
# Exact versions for Python 3.11, written by `make pins`; ranges are in pyproject.toml.
"""

CONDA_HEAD = """\
# The environment of every rule: the ranges of pyproject.toml. Written by `make pins`; the library
# itself is installed by lfcore.post-deploy.sh. Used with
# `snakemake --software-deployment-method conda`; without it, the packages of the Python that runs
# Snakemake are used.
channels:
  - conda-forge
  - nodefaults
dependencies:
  - python >=3.11
  - pip
"""
# Names in conda-forge where they differ; None: there is none, and the wheel is taken.
CONDA_NAMES = {
    "opencv-contrib-python-headless": "py-opencv",
    "openexr": "openexr-python",
    "matplotlib": "matplotlib-base",
    "intel-opencl-rt": None,
    "intel-cmplr-lib-rt": None,
    "bjontegaard": None,
    "dracopy": None,
}


def name_of(requirement: str) -> str:
    """The name of a requirement as package indices compare it."""
    return canonicalize_name(Requirement(requirement).name)


def installed() -> list[str]:
    """``name==version`` of every package of this environment but lfcore and the installers."""
    named = ((one.metadata["Name"], one.version) for one in importlib.metadata.distributions())
    found = {canonicalize_name(name): f"{name}=={version}" for name, version in named}
    return [found[name] for name in sorted(found.keys() - NOT_OURS)]


def needed_by_rules() -> list[str]:
    """Requirements of the library and of the workflow's reports, but for Snakemake."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    every = project["dependencies"] + project["optional-dependencies"]["workflow"]
    return [one for one in every if name_of(one) != "snakemake"]


def stale() -> Iterator[str]:
    """What `make pins` would mend."""
    made = (ROOT / "workflow" / "envs" / "lfcore.yaml").read_text(encoding="utf-8")
    if made != conda_environment():
        yield "workflow/envs/lfcore.yaml"
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    pinned = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    asked = [*needed_by_rules(), *project["optional-dependencies"]["dev"]]
    if missing := {name_of(one) for one in asked} - {
        name_of(one) for one in pinned if one[:1].isalnum()
    }:
        yield f"constraints.txt, without {', '.join(sorted(missing))}"


def conda_environment() -> str:
    """The text of workflow/envs/lfcore.yaml."""
    return CONDA_HEAD + "".join(_conda_lines(needed_by_rules()))


def _conda_lines(requirements: list[str]) -> Iterator[str]:
    wheels = [one for one in requirements if CONDA_NAMES.get(name_of(one), "") is None]
    for one in requirements:
        if one not in wheels:
            name = CONDA_NAMES.get(name_of(one), name_of(one))
            yield f"  - {name} {one[len(name_of(one)) :].strip()}\n"
    yield "  - pip:\n"
    for one in wheels:
        yield f'      - "{one}"\n'


def main() -> None:
    if sys.argv[1:] == ["--check"]:
        sys.exit("; ".join(f"{file}: run `make pins`" for file in stale()) or 0)
    pins = sorted([*installed(), BUILD_BACKEND], key=str.lower)
    write_text(ROOT / "constraints.txt", CONSTRAINTS_HEAD + "\n".join(pins) + "\n")
    write_text(ROOT / "workflow" / "envs" / "lfcore.yaml", conda_environment())


if __name__ == "__main__":
    main()
