"""What is asked of a cluster before the first job, so that a mistake is one line and not many."""

from __future__ import annotations

import shutil
import subprocess

from lfcore.errors import SettingsError


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


def check_partition(partition: str | None) -> None:
    """Raise :class:`SettingsError` for a partition that this SLURM does not have."""
    if not partition or not shutil.which("sinfo"):
        return
    done = subprocess.run(
        ["sinfo", "-h", "-o", "%R"], capture_output=True, text=True, timeout=60, check=False
    )
    known = sorted(set(done.stdout.split()))
    if done.returncode:
        raise SettingsError(
            f"SLURM does not answer: {done.stderr.strip() or 'sinfo failed'}",
            remedy="Run it where sbatch works, as on a login node",
        )
    if partition not in known:
        raise SettingsError(
            f"there is no partition {partition!r}",
            key="default-resources: slurm_partition",
            remedy=f"This cluster has {', '.join(known)}",
        )
