"""Configurations of the workflow, up to the plan of the first job."""

import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import yaml

from lfcore.optics.camera import Camera
from lfcore.workflow import cases, costs
from lfcore.workflow.settings import check_settings
from robustness.inputs import Inputs, damaged_text, damaged_yaml
from robustness.outcome import ROOT, Outcome, outcome_of
from robustness.targets import Target

_OPENS = re.compile(rb"[\[{]|[-?] ")
CAMERA = Camera(0.05, 0.036, 2.0, 3.0)


def seeds(folder: Path) -> list[bytes]:
    files = ("config/smoke.yaml", "config/config.yaml", "config/thesis.yaml")
    texts = [(ROOT / file).read_bytes() for file in files]
    # A run's configuration overrides the default one, as in Snakemake.
    default = yaml.safe_load(texts[1])
    texts = [yaml.dump(default | yaml.safe_load(text)).encode() for text in texts]
    planes = b"planes: [{focus_m: 3, f_number: 4, aperture: polygon, blades: 5}]\n"
    return [*texts, b"scenes: [bike]\ntile_mib: 1\nstore: false\n" + planes]


def judge(data: bytes, folder: Path) -> Outcome:
    """Check a configuration and plan with it, as the Snakefile does.

    Snakemake itself reports files that are no YAML or no mapping.
    """
    # The reader in C is fast, but crashes on deep nesting.
    deep = len(_OPENS.findall(data)) > 1000
    try:
        config = yaml.load(io.BytesIO(data), yaml.SafeLoader if deep else yaml.CSafeLoader)
    except (yaml.YAMLError, ValueError, RecursionError):
        return Outcome("refused")
    if not isinstance(config, Mapping):
        return Outcome("refused")

    def work() -> None:
        settings = check_settings(config)
        cases.scene_files(settings["scenes"])
        for views in settings["views"]:
            costs.named_batches(settings, views)
            cases.encoding(settings, views)
        cases.sensor_planes(settings["planes"], CAMERA, (3.0,))

    return outcome_of(work, names="configuration")


def inputs(seeds: Sequence[bytes]) -> Inputs:
    return damaged_yaml(seeds) | damaged_text(seeds)


def targets() -> list[Target]:
    return [Target("config.yaml", seeds, inputs, judge)]
