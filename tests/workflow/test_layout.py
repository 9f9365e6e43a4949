"""The workflow as Snakemake's own tools meet it: linted without the library, and deployed."""

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
    done = type(checkout)(tmp_path).snakemake("--lint", PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stdout


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
