"""What is asked of a run's folder, storage and cluster before the first job."""

from types import SimpleNamespace

import pytest

from lfcore.errors import SettingsError, StorageError
from lfcore.workflow import cluster


@pytest.fixture
def sinfo(tmp_path, monkeypatch):
    """A function that puts a ``sinfo`` of these words and status first in the path."""

    def made(words, status=0):
        program = tmp_path / "sinfo"
        program.write_text(f"#!/bin/sh\n{words}\nexit {status}\n")
        program.chmod(0o755)
        monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")

    return made


def test_a_partition_that_is_not_there_is_one_line(sinfo):
    sinfo("printf 'long\\nshort\\n'")
    cluster.check_partitions(["long", "short"])
    cluster.check_partitions([])
    with pytest.raises(SettingsError, match=r"no partition 'lnog'\. This cluster has long, short"):
        cluster.check_partitions(["lnog", "long"])


def test_partitions_are_those_of_the_jobs_that_run_on_this_cluster():
    def job(**resources):
        return SimpleNamespace(resources=resources)

    named = job(slurm_partition="long"), job(slurm_partition="long,short"), job()
    elsewhere = job(slurm_partition="other", clusters="east")
    assert cluster.partitions_of([*named, elsewhere]) == {"long", "short"}


def test_a_folder_that_takes_no_files_is_one_line(tmp_path):
    cluster.check_folder(tmp_path)
    assert not [file for file in tmp_path.rglob("*") if file.is_file()]
    (tmp_path / "file").touch()
    with pytest.raises(StorageError, match=r"file/\.snakemake.* cannot be written: .*Free space"):
        cluster.check_folder(tmp_path / "file")


def test_a_slurm_that_does_not_answer_says_so(sinfo):
    sinfo("echo 'Unable to contact slurm controller' >&2", 1)
    with pytest.raises(SettingsError, match=r"does not answer: Unable to contact.*login node"):
        cluster.check_partitions(["long"])


class Storage:
    """As much of the storage plugin as is asked."""

    def __init__(self, buckets):
        self.s3c = self.meta = self.client = self
        self.buckets = buckets

    def head_bucket(self, Bucket):
        if Bucket not in self.buckets:
            raise RuntimeError("404 Not Found")


def test_a_bucket_that_is_not_there_is_one_line():
    cluster.check_bucket(None, None)
    cluster.check_bucket(Storage({"mine"}), "s3://mine/run")
    with pytest.raises(SettingsError, match=r"no bucket 'mnie' .*404 Not Found\. Make it"):
        cluster.check_bucket(Storage({"mine"}), "s3://mnie/run")
