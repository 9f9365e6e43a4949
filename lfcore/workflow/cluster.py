"""What is asked of a folder, storage and cluster before the first job: a mistake is one line."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from lfcore.errors import SettingsError
from lfcore.files import write_text

ROOM_BYTES = 1 << 18
"""What Snakemake's log and locks take at once, and more."""


def check_folder(folder: str | Path) -> None:
    """Raise :class:`StorageError` where a run's folder takes no files: its disk or the user's share
    of it is full, or it may not be written; Snakemake ends there in tracebacks."""
    probe = Path(folder).absolute() / ".snakemake" / "probe"
    write_text(probe, " " * ROOM_BYTES)
    probe.unlink(missing_ok=True)


def check_bucket(provider: object, prefix: str | None) -> None:
    """Raise :class:`SettingsError` where ``prefix`` (s3://BUCKET/NAME) names a bucket that is not
    there, or not ours; the storage plugin would make one of a name that was mistyped."""
    client = getattr(provider, "s3c", None)
    if client is None or not prefix:
        return
    bucket = prefix.partition("://")[2].split("/")[0]
    try:
        client.meta.client.head_bucket(Bucket=bucket)
    except Exception as error:  # botocore makes its classes of errors as it goes
        raise SettingsError(
            f"there is no bucket {bucket!r} that can be read: {error}",
            key="default-storage-prefix",
            remedy="Make it, or check its name, the endpoint and the keys",
        ) from None


def partitions_of(jobs: Iterable[Any]) -> set[str]:
    """Names of the partitions that Snakemake's ``jobs`` ask for; of a list any will do.

    Those of another cluster, which a job names, are not known here.
    """
    found = set()
    for job in jobs:
        if not any(job.resources.get(name) for name in ("cluster", "clusters", "slurm_cluster")):
            found |= set(str(job.resources.get("slurm_partition") or "").split(","))
    return found - {""}


def check_partitions(partitions: Iterable[str]) -> None:
    """Raise :class:`SettingsError` for a partition that this SLURM does not have."""
    wanted = set(partitions)
    if not wanted or not shutil.which("sinfo"):
        return
    done = subprocess.run(  # hidden partitions, too
        ["sinfo", "-a", "-h", "-o", "%R"], capture_output=True, text=True, timeout=60, check=False
    )
    known = sorted(set(done.stdout.split()))
    if done.returncode:
        raise SettingsError(
            f"SLURM does not answer: {done.stderr.strip() or 'sinfo failed'}",
            remedy="Run it where sbatch works, as on a login node",
        )
    for partition in sorted(wanted.difference(known)):
        raise SettingsError(
            f"there is no partition {partition!r}",
            key="slurm_partition",
            remedy=f"This cluster has {', '.join(known)}",
        )
