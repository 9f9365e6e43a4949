"""The workflow as Snakemake's own tools meet it: linted without the library, and deployed."""

import os
import shutil
import subprocess
import sys

import pytest

pytestmark = pytest.mark.workflow


def test_the_workflow_is_linted_where_only_snakemake_is_installed(checkout, tmp_path):
    """As the workflow catalog does."""
    (tmp_path / "lfcore.py").write_text("raise ImportError('there is no lfcore here')\n")
    for name in ("Snakefile", "workflow", "config", "profiles"):
        source = checkout.folder / name
        (shutil.copytree if source.is_dir() else shutil.copy)(source, tmp_path / name)
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--lint"], cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr


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
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--cores", "2", "--configfile", "config/smoke.yaml",
         "--config", "scenes=[bike]"],
        cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(checkout.folder)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    for name in ("index.html", "table_7_1.csv", "figures/focal_stack_bike.png"):
        assert (tmp_path / "results" / "tables" / name).is_file()
