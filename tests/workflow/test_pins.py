"""Pins: exact, the same everywhere, and enough for what pyproject.toml asks."""

import re
import tomllib

import yaml

from robustness.kills import PARTS
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
    assert len(intel) == 2 and all("platform_machine == 'x86_64'" in one for one in intel)


def test_pins_are_those_of_the_names():
    assert name_of("PyYAML >=6") == "pyyaml" and name_of("a_b.c[x]>=1; python") == "a-b-c"


def test_the_container_holds_what_the_workflow_reads_in_exact_versions():
    lines = (ROOT / "workflow/envs/Containerfile").read_text().splitlines()
    copied = {name for line in lines if line.startswith("COPY") for name in line.split()[1:-1]}
    assert all((ROOT / name).exists() for name in copied)
    assert {*PARTS, "pyproject.toml", "constraints.txt"} <= copied
    (install,) = (line for line in lines if "pip install" in line)
    assert "--constraint constraints.txt" in install and "'.[workflow,s3]'" in install
    (base,) = (line for line in lines if line.startswith("FROM"))
    assert re.match(r"FROM python:3\.11-", base)  # of which the exact versions are


def test_continuous_integration_runs_targets_that_are_there():
    jobs = yaml.safe_load((ROOT / ".github/workflows/ci.yml").read_text())["jobs"]
    makefile = (ROOT / "Makefile").read_text()
    steps = [step["run"] for job in jobs.values() for step in job["steps"] if "run" in step]
    targets = {word for step in steps for word in re.findall(r"make (\w+)", step)}
    assert {"lint", "test", "wheel", "micro"} <= targets
    assert all(re.search(rf"^{target}:", makefile, re.MULTILINE) for target in targets)
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    known = {one.rpartition(" ")[2] for one in project["classifiers"] if "Python :: 3." in one}
    grids = [job.get("strategy", {}).get("matrix", {}) for job in jobs.values()]
    pythons = {one for grid in grids for one in grid.get("python", ())}
    assert pythons == known and len(jobs["test"]["strategy"]["matrix"]["python"]) >= 2
