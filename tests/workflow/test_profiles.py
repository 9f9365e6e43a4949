"""Profiles of clusters and object storage: planned, submitted in groups, run on an S3 server."""

import logging
import os
import subprocess
import sys

import numpy as np
import pytest

from lfcore import LightField
from robustness.outcome import ROOT

pytestmark = pytest.mark.workflow
KEYS = {"SNAKEMAKE_STORAGE_S3_ACCESS_KEY": "any", "SNAKEMAKE_STORAGE_S3_SECRET_KEY": "any"}
PLUGINS = {
    "slurm": ["snakemake_executor_plugin_slurm"],
    "s3": ["snakemake_storage_plugin_s3"],
    "kubernetes": ["snakemake_executor_plugin_kubernetes", "snakemake_storage_plugin_s3"],
}
TABLES = ("--", "results/tables/")
SMALL = (
    "--configfile", "config/micro.yaml",
    "--config", "scenes=[sphere]", "views=[4]", "pixels=16", "reports=[]",
)  # fmt: skip


def needed(profile):
    for plugin in PLUGINS.get(profile, []):
        pytest.importorskip(plugin)


@pytest.fixture(scope="module")
def storage():
    """The URL of an S3 server on the loopback interface."""
    moto = pytest.importorskip("moto.server")
    pytest.importorskip("s3fs")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)  # no line for each request
    server = moto.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    yield "http://{}:{}".format(*server.get_host_and_port())
    server.stop()


def store(url, bucket):
    import fsspec

    made = fsspec.filesystem(
        "s3", key="any", secret="any", endpoint_url=url, use_listings_cache=False
    )
    made.mkdir(bucket)
    return made


def snakemake(*words):
    return subprocess.run(
        [sys.executable, "-m", "snakemake", *words],
        cwd=ROOT, env=os.environ | KEYS, capture_output=True, text=True, timeout=420,
    )  # fmt: skip


def test_every_key_of_every_profile_is_an_option(tmp_path, capsys):
    from snakemake.cli import parse_args

    profiles = sorted((ROOT / "profiles").iterdir())
    assert {profile.name for profile in profiles} == {"default", *PLUGINS}
    for profile in profiles:
        needed(profile.name)
        parse_args(["--workflow-profile", str(profile), "--dry-run"])
    (tmp_path / "config.yaml").write_text("no-such-option: 1\n")
    with pytest.raises(SystemExit):
        parse_args(["--workflow-profile", str(tmp_path), "--dry-run"])
    assert "no-such-option" in capsys.readouterr().err


def test_slurm_is_planned(checkout):
    needed("slurm")
    smoke = ("--configfile", "config/smoke.yaml", "--dry-run")
    done = checkout.snakemake("--workflow-profile", "profiles/slurm", *smoke, *TABLES)
    assert done.returncode == 0, done.stdout[-4000:]
    assert "runtime=10" in done.stdout and "lanes=1" in done.stdout


def test_groups_are_submitted_and_make_the_same_light_field(project_copy):
    """Each submission runs as a command of the shell, with the settings of the SLURM profile."""
    pytest.importorskip("snakemake_executor_plugin_cluster_generic")
    checkout = project_copy("submitted")
    folder = checkout.folder
    profile = (folder / "profiles" / "slurm" / "config.yaml").read_text()
    lines = [line for line in profile.splitlines() if not line.startswith("slurm")]
    text = "\n".join(lines).replace("executor: slurm", "executor: cluster-generic")
    (folder / "profiles" / "shell").mkdir()
    (folder / "profiles" / "shell" / "config.yaml").write_text(text)
    submit = folder / "submit.sh"
    submit.write_text('echo "$1" >> submissions\nsh "$1" > said 2>&1 || exit 1\necho "$1"\n')
    words = ("--workflow-profile", "profiles/shell", "--cluster-generic-submit-cmd", f"sh {submit}")
    table = "results/tables/table_7_3.csv"
    words += ("--seconds-between-status-checks", "1")
    done = checkout.snakemake(*words, *SMALL, "--", table)
    assert done.returncode == 0, done.stdout[-4000:]
    submissions = len((folder / "submissions").read_text().splitlines())
    jobs = done.stdout.split("Job stats:")[1].split("\n\n")[0].split()
    assert 2 <= submissions < int(jobs[-1]) / 3  # many jobs per submission
    assert (folder / table).is_file()
    field = "results/sphere/M16/N4/lightfield.mkv"
    submitted = (folder / field).read_bytes()
    assert checkout.made(*SMALL, "--forceall", "--", field)["trace"] == 1
    assert (folder / field).read_bytes() == submitted


def test_results_are_objects(storage, tmp_path):
    needed("s3")
    objects = store(storage, "mine")
    field = "results/sphere/M16/N4/lightfield.mkv"
    done = snakemake(
        "--workflow-profile", "profiles/s3", "--storage-s3-endpoint-url", storage,
        "--default-storage-prefix", "s3://mine/run", "--directory", str(tmp_path), *SMALL,
        "--", field,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-4000:]
    assert not (tmp_path / field).exists()
    (tmp_path / "copy.mkv").write_bytes(objects.cat(f"mine/run/{field}"))
    keys = {"AWS_ENDPOINT_URL": storage, "AWS_ACCESS_KEY_ID": "any", "AWS_SECRET_ACCESS_KEY": "any"}
    with pytest.MonkeyPatch.context() as patched:
        for name, value in keys.items():
            patched.setenv(name, value)
        type(objects).clear_instance_cache()  # of another test's server
        view = LightField.open(f"s3://mine/run/{field}").view(1, 2, codes=True)
    assert np.array_equal(view, LightField.open(tmp_path / "copy.mkv").view(1, 2, codes=True))


def test_kubernetes_is_planned_with_an_image_and_no_shared_folder(storage, tmp_path):
    needed("kubernetes")
    store(storage, "pods")
    done = snakemake(
        "--workflow-profile", "profiles/kubernetes", "--storage-s3-endpoint-url", storage,
        "--default-storage-prefix", "s3://pods/run", "--directory", str(tmp_path),
        "--configfile", "config/smoke.yaml", "--dry-run", "--", "results/tables/index.html",
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert "s3://pods/run/results/tables/index.html (send to storage)" in done.stdout
    assert not list(tmp_path.glob("results"))
