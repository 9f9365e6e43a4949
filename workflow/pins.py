"""Write constraints.txt and the conda environment from the packages installed now.

    python -m workflow.pins

Both hold the same exact pins, without any address of an index.  A test compares them.
"""

from __future__ import annotations

import importlib.metadata
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
BUILD_BACKEND = "flit_core==4.2.0"
NOT_OURS = {"lfcore", "pip", "setuptools", "wheel", "flit-core"}

CONSTRAINTS_HEAD = """\
# Exact versions for Python 3.11, written by `make pins`; ranges are in pyproject.toml.
"""

CONDA_HEAD = """\
# The environment of every rule: the same pins as constraints.txt. Written by `make pins`.
# Used with `snakemake --software-deployment-method conda`; without it, the packages of the Python
# that runs Snakemake are used.
channels:
  - conda-forge
  - nodefaults
dependencies:
  - python =3.11
  - pip
  - pip:
"""

# What a job needs is less than what a developer needs.
DEVELOPMENT = {
    "ast-serialize",
    "black",
    "drjit",
    "embreex",
    "execnet",
    "grimp",
    "h5py",
    "hypothesis",
    "import-linter",
    "iniconfig",
    "librt",
    "lxml",
    "markdown-it-py",
    "mdurl",
    "mitsuba",
    "mypy",
    "mypy-extensions",
    "pathspec",
    "pluggy",
    "pytest",
    "pytest-xdist",
    "pytokens",
    "rich",
    "ruff",
    "shfmt-py",
    "snakefmt",
    "sortedcontainers",
    "types-pyyaml",
}


def canonical(name: str) -> str:
    """The name as package indices compare it: lower case, one hyphen for any separator."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed() -> list[str]:
    """``name==version`` of every package of this environment but lfcore and the installers."""
    found = {}
    for package in importlib.metadata.distributions():
        name = package.metadata["Name"]
        if canonical(name) not in NOT_OURS:
            found[canonical(name)] = f"{name}=={package.version}"
    return [found[name] for name in sorted(found)]


def main() -> None:
    pins = sorted([*installed(), BUILD_BACKEND], key=str.lower)
    (ROOT / "constraints.txt").write_text(CONSTRAINTS_HEAD + "\n".join(pins) + "\n")
    runtime = [pin for pin in pins if canonical(pin.split("==")[0]) not in DEVELOPMENT]
    runtime.remove(BUILD_BACKEND)
    lines = "".join(f"      - {pin}\n" for pin in runtime)
    (ROOT / "workflow" / "envs" / "lfcore.yaml").write_text(CONDA_HEAD + lines)


if __name__ == "__main__":
    main()
