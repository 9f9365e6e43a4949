"""Profiles that Snakemake and its plugins know, a linted workflow, and one that is deployed."""

import importlib.util
import os
import shutil
import subprocess
import sys

import pytest

from robustness.object_storage import KEYS
from robustness.outcome import ROOT

PLUGINS = {
    "slurm": ["snakemake_executor_plugin_slurm"],
    "s3": ["snakemake_storage_plugin_s3"],
    "kubernetes": ["snakemake_executor_plugin_kubernetes", "snakemake_storage_plugin_s3"],
}
PARSE = """
import sys
from snakemake.cli import parse_args
for profile in sys.argv[1:]:
    parse_args(["--workflow-profile", profile, "--dry-run"])
"""


def needed(profile):
    absent = [one for one in PLUGINS.get(profile, []) if importlib.util.find_spec(one) is None]
    if absent:
        pytest.skip(f"{', '.join(absent)} not installed")


def parsed(*profiles):
    return subprocess.run(
        [sys.executable, "-c", PARSE, *map(str, profiles)], capture_output=True, text=True
    )


@pytest.mark.workflow
def test_every_key_of_every_profile_is_an_option(tmp_path):
    profiles = sorted((ROOT / "profiles").iterdir())
    assert {profile.name for profile in profiles} == {"default", *PLUGINS}
    for profile in profiles:
        needed(profile.name)
    done = parsed(*profiles)
    assert done.returncode == 0, done.stderr
    (tmp_path / "config.yaml").write_text("no-such-option: 1\n")
    wrong = parsed(tmp_path)
    assert wrong.returncode and "no-such-option" in wrong.stderr


@pytest.mark.workflow
def test_kubernetes_is_planned_with_an_image_and_no_shared_folder(tmp_path):
    needed("kubernetes")
    moto = pytest.importorskip("moto.server")
    server = moto.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    try:
        url = f"http://127.0.0.1:{server.get_host_and_port()[1]}"
        import boto3

        keys = {"aws_access_key_id": "any", "aws_secret_access_key": "any"}
        boto3.client("s3", endpoint_url=url, region_name="us-east-1", **keys).create_bucket(
            Bucket="mine"
        )
        done = subprocess.run(
            [sys.executable, "-m", "snakemake", "--workflow-profile", "profiles/kubernetes",
             "--storage-s3-endpoint-url", url, "--default-storage-prefix", "s3://mine/run",
             "--directory", str(tmp_path), "--configfile", "config/smoke.yaml", "--dry-run",
             "--", "results/tables/index.html"],
            cwd=ROOT, env=os.environ | KEYS, capture_output=True, text=True,
        )  # fmt: skip
    finally:
        server.stop()
    assert done.returncode == 0, done.stdout + done.stderr
    assert "s3://mine/run/results/tables/index.html (send to storage)" in done.stdout
    assert not list(tmp_path.glob("results"))


@pytest.mark.workflow
def test_the_workflow_is_linted_where_only_snakemake_is_installed(checkout, tmp_path):
    """As the workflow catalog does."""
    (tmp_path / "lfcore.py").write_text("raise ImportError('there is no lfcore here')\n")
    for name in ("Snakefile", "workflow", "config", "profiles"):
        source = checkout.folder / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    done = type(checkout)(tmp_path).snakemake("--lint", PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stdout


@pytest.mark.workflow
def test_a_deployed_workflow_runs_smoke(checkout, tmp_path):
    pytest.importorskip("snakedeploy")
    words = ("deploy-workflow", str(checkout.folder), str(tmp_path), "--branch=main", "--force")
    program = "import sys; from snakedeploy.client import main; sys.exit(main())"
    subprocess.run([sys.executable, "-c", program, *words], check=True)
    # Of a folder on this machine, snakedeploy writes the path without the folder.
    snakefile = tmp_path / "workflow" / "Snakefile"
    text = snakefile.read_text()
    assert '"workflow/Snakefile"' in text
    snakefile.write_text(text.replace('"workflow/', f'"{checkout.folder}/workflow/'))
    words = ("--cores", "2", "--configfile", "config/smoke.yaml", "--config", "scenes=[bike]")
    done = type(checkout)(tmp_path).snakemake(*words, "views=[16]", PYTHONPATH=str(checkout.folder))
    assert done.returncode == 0, done.stdout
    for name in ("index.html", "table_7_1.csv", "figures/focal_stack_bike.png"):
        assert (tmp_path / "results" / "tables" / name).is_file()
