"""A SLURM of one node on the loopback interface, which ends with the ``with`` block.

No systemd, cgroups or database: munged, slurmctld and slurmd run as the user who calls, below one
folder.  Debian's packages: ``apt-get install slurm-wlm munge``.
"""

import getpass
import os
import secrets
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from importlib.util import find_spec
from pathlib import Path

import psutil

from robustness.kills import started

PROGRAMS = ("munged", "munge", "slurmctld", "slurmd", "sbatch", "srun", "squeue", "scancel")
PLUGIN = "snakemake-executor-plugin-slurm"
PATHS = "/usr/sbin:/usr/bin:/sbin:/bin"
CONFIGURATION = Path(__file__).with_name("slurm.conf")


class CannotRun(RuntimeError):
    """What a throw-away SLURM needs is not there, or did not start."""


def missing() -> list[str]:
    """Programs, and Snakemake's plugin, that are not installed."""
    absent = [name for name in PROGRAMS if not shutil.which(name, path=PATHS)]
    return absent + ([] if find_spec("snakemake_executor_plugin_slurm") else [PLUGIN])


@dataclass
class LocalSlurm:
    """The running servers; commands of SLURM find them by ``environment``."""

    folder: Path
    environment: dict[str, str]
    _servers: list[subprocess.Popen] = field(default_factory=list)
    _node: subprocess.Popen | None = None

    def command(self, *words: str, check: bool = True) -> str:
        done = subprocess.run(
            words, env=self.environment, capture_output=True, text=True, timeout=60, check=False
        )
        if check and done.returncode:
            raise CannotRun(f"{' '.join(words)}: {done.stderr.strip()}")
        return done.stdout

    def running(self) -> list[str]:
        return self.command("squeue", "-h", "-t", "R", "-o", "%A").split()

    def jobs(self) -> list[dict[str, str]]:
        """Number, name, state, times, and what was asked for, of every job since the start."""
        keys = {
            "number": "JobID:32", "name": "Name:80", "state": "State:32",
            "begun": "StartTime:32", "ended": "EndTime:32",
            "limit": "TimeLimit:32", "memory": "MinMemory:32", "comment": "Comment:200",
        }  # fmt: skip
        text = self.command("squeue", "-h", "-t", "all", "-O", ",".join(keys.values()))
        return [dict(zip(keys, line.split(), strict=False)) for line in text.splitlines()]

    def start_node(self) -> None:
        self._node = self.start("slurmd", "-D", "-N", "node", "-f", self.environment["SLURM_CONF"])
        _until(
            lambda: self.command("sinfo", "-h", "-o", "%T").strip() == "idle", 40,
            "slurmd did not start", self.folder / "slurmd.log",
        )  # fmt: skip

    def kill_node(self) -> None:
        """The node dies, with all that runs on it; SLURM is told, as by who watches over it."""
        assert self._node
        for process in (self._node.pid, *self.of_node()):
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)
        self._node.wait()
        self._servers.remove(self._node)
        self.command("scontrol", "update", "nodename=node", "state=down", "reason=died")

    def revive_node(self) -> None:
        self.command("scontrol", "update", "nodename=node", "state=resume")
        self.start_node()

    def of_node(self) -> set[int]:
        """Processes of its jobs, and those that watch over them: nobody's children."""
        this = psutil.Process()
        ours = {this.pid, *(child.pid for child in this.children(recursive=True))}
        found = set()
        for process in psutil.process_iter():
            with suppress(psutil.Error):
                mine = process.environ().get("SLURM_CONF") == self.environment["SLURM_CONF"]
                if process.pid in ours or not mine:
                    continue
                found |= {process.pid, *(child.pid for child in process.children(recursive=True))}
                parent = process.parent()
                if parent and parent.name().startswith("slurmstepd"):
                    found.add(parent.pid)
        return found - ours

    def start(self, *words: str) -> subprocess.Popen:
        self._servers.append(started(words, self.folder / f"{words[0]}.out", self.environment))
        return self._servers[-1]

    def stop(self) -> None:
        """Cancel what runs, then end the servers that were started, by their numbers."""
        with suppress(subprocess.TimeoutExpired):
            self.command("scancel", "-u", getpass.getuser(), check=False)
        _until(lambda: not self.command("squeue", "-h", "-t", "R,CG"), 15)
        for server in reversed(self._servers):
            server.terminate()
            try:
                server.wait(10)
            except subprocess.TimeoutExpired:
                server.kill()
                server.wait()


@contextmanager
def local_slurm(folder: Path) -> Iterator[LocalSlurm]:
    """A :class:`LocalSlurm` below ``folder``, an absolute path that is short.

    Raises :class:`CannotRun` where a server does not start.
    """
    for name in ("state", "spool", "munge", "bin"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    (folder / "munge").chmod(0o711)
    key = folder / "munge" / "key"
    key.write_bytes(secrets.token_bytes(128))
    key.chmod(0o600)
    conf, (port, node_port) = folder / "slurm.conf", _free_ports()
    places = {"folder": folder, "user": getpass.getuser(), "port": port, "node_port": node_port}
    text = CONFIGURATION.read_text(encoding="utf-8")
    conf.write_text(text.format(**places))
    # Snakemake's job step starts its srun without SLURM_CONF, which a site has in /etc.
    shim = folder / "bin" / "srun"
    real = shutil.which("srun", path=PATHS)
    shim.write_text(f'#!/bin/sh\nSLURM_CONF={conf} exec {real} "$@"\n')
    shim.chmod(0o755)
    path = f"{shim.parent}:{os.environ['PATH']}:{PATHS}"
    slurm = LocalSlurm(folder, os.environ | {"SLURM_CONF": str(conf), "PATH": path})
    try:
        _start(slurm, folder, conf)
        yield slurm
    finally:
        slurm.stop()


def _free_ports() -> tuple[int, int]:
    """Two ports that nobody listens at."""
    with (
        socket.create_server(("127.0.0.1", 0)) as one,
        socket.create_server(("127.0.0.1", 0)) as two,
    ):
        return one.getsockname()[1], two.getsockname()[1]


def _start(slurm: LocalSlurm, folder: Path, conf: Path) -> None:
    munge = folder / "munge"
    slurm.start(
        "munged", "--foreground", "--force", f"--key-file={munge}/key",
        f"--socket={munge}/socket", f"--pid-file={munge}/pid", f"--log-file={munge}/log",
        f"--seed-file={munge}/seed",
    )  # fmt: skip
    ready = ("munge", "-n", f"--socket={munge}/socket")
    _until(lambda: slurm.command(*ready), 20, "munged did not start", munge / "log")
    slurm.start("slurmctld", "-D", "-i", "-f", str(conf))
    log = folder / "slurmctld.log"
    _until(lambda: slurm.command("scontrol", "ping"), 30, "slurmctld did not start", log)
    slurm.start_node()


def _until(
    condition: Callable[[], object], seconds: float, problem: str = "", log: Path | None = None
) -> None:
    """Wait for ``condition``; where it does not come, :class:`CannotRun` with the log's end."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        with suppress(CannotRun, subprocess.TimeoutExpired):
            if condition():
                return
        time.sleep(0.2)
    if problem:
        said = log.read_text(errors="replace").splitlines()[-3:] if log and log.exists() else []
        raise CannotRun(f"{problem}: {' '.join(said)}")
