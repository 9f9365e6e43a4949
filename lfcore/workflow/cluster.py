"""What is asked of a cluster before the first job, so that a mistake is one line and not many."""

from __future__ import annotations

import shutil
import subprocess

from lfcore.workflow.settings import SettingsError


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
