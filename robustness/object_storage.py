"""The workflow with its results in object storage, killed in between and finished by a second run.

    python -m robustness.object_storage           (make s3)

The server is moto's, on the loopback interface.  Says whether the objects are those of a run that
was not killed, and opens a light field by its name in the storage.  Skipped, aloud, where a package
is missing.
"""

import hashlib
import importlib.util
import logging
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import fsspec
from fsspec import AbstractFileSystem

from robustness.kills import make_run, started
from robustness.outcome import ROOT

PACKAGES = ("moto", "s3fs", "snakemake_storage_plugin_s3")
KEPT = (".mkv", "on_the_fly.npz", "from_video.npz", "scene.npz", "bvh.npz")
"""Objects without seconds, which must be the same to the last bit."""
KEYS = {"SNAKEMAKE_STORAGE_S3_ACCESS_KEY": "any", "SNAKEMAKE_STORAGE_S3_SECRET_KEY": "any"}
SMALL = "scenes=[chart] views=[4,8] pixels=32 reports=[]"


@contextmanager
def server() -> Iterator[str]:
    """The URL of a server that speaks S3, while the block lasts."""
    from moto.server import ThreadedMotoServer

    logging.getLogger("werkzeug").setLevel(logging.ERROR)  # no line for each request
    threaded = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    threaded.start()
    try:
        yield "http://{}:{}".format(*threaded.get_host_and_port())
    finally:
        threaded.stop()


def start(url: str, folder: Path, prefix: str) -> subprocess.Popen:
    """A run whose results are objects below ``prefix``."""
    folder.mkdir(exist_ok=True)
    arguments = (
        f"--workflow-profile profiles/s3 --storage-s3-endpoint-url {url} "
        f"--default-storage-prefix {prefix} --configfile config/micro.yaml "
        f"--config {SMALL} -- results/tables/index.html"
    )
    return started(make_run(arguments, str(folder)), folder / "terminal", os.environ | KEYS)


def objects(store: AbstractFileSystem, bucket: str) -> dict[str, str]:
    """Name and SHA-256 of each object that is kept."""
    kept = (name for name in store.find(bucket) if name.endswith(KEPT))
    return {
        name.partition("results/")[2]: hashlib.sha256(store.cat(name)).hexdigest() for name in kept
    }


def check(folder: Path, url: str) -> list[str]:
    """What is wrong; empty when all is well."""
    store = fsspec.filesystem(
        "s3", key="any", secret="any", endpoint_url=url, use_listings_cache=False
    )
    for bucket in ("undisturbed", "killed"):
        store.mkdir(bucket)
    begun = time.monotonic()
    if start(url, folder / "undisturbed", "s3://undisturbed/run").wait():
        return [(folder / "undisturbed" / "terminal").read_text()[-3000:]]
    wanted = objects(store, "undisturbed")
    print(f"undisturbed: {len(wanted)} objects in {time.monotonic() - begun:.0f} s", flush=True)
    first = start(url, folder / "killed", "s3://killed/run")
    while first.poll() is None and not any(
        name.endswith("0000.segments") for name in store.find("killed")
    ):
        time.sleep(0.2)
    if first.poll() is not None:
        return ["the run ended before it was killed"]
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    before = len(objects(store, "killed"))
    status = start(url, folder / "killed", "s3://killed/run").wait()
    found = objects(store, "killed")
    same = found == wanted
    print(f"killed after {before} objects, gone on with: status {status}, {len(found)} objects, "
          f"{'identical' if same else 'DIFFERENT'}", flush=True)  # fmt: skip
    wrong = [] if same and not status else [(folder / "killed" / "terminal").read_text()[-3000:]]
    return wrong + where_it_lies(url)


def where_it_lies(url: str) -> list[str]:
    """Open a light field by its name in the storage, in a process whose environment names it."""
    program = (
        "from lfcore import LightField\n"
        "field = LightField.open('s3://killed/run/results/chart/M32/N8/lightfield.mkv')\n"
        "print('view of s3://...:', field.view(3, 4, codes=True).shape)\n"
    )
    keys = {"AWS_ENDPOINT_URL": url, "AWS_ACCESS_KEY_ID": "any", "AWS_SECRET_ACCESS_KEY": "any"}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, env=os.environ | keys, check=False,
        capture_output=True, text=True,
    )  # fmt: skip
    print(done.stdout.strip(), flush=True)
    return [done.stderr[-1000:]] if done.returncode else []


def main() -> int:
    if absent := [name for name in PACKAGES if importlib.util.find_spec(name) is None]:
        print(f"SKIPPED: {', '.join(absent)} not found (pip install 'lfcore[s3,dev]')")
        return 0
    with tempfile.TemporaryDirectory() as name, server() as url:
        wrong = check(Path(name), url)
    print("\n".join(wrong))
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
