"""Compares another commit with this tree: python -m benchmarks.against REVISION [STATEMENT ...]

Each Python statement runs in both checkouts, in two processes that take turns. The numbers are
processor seconds of the other checkout, of this one, and their ratio. The setup is as in timeit:

    python -m benchmarks.against HEAD~1 "lfcore.render(scene, pixels=256, views=16)" \\
        --setup "import lfcore; scene = lfcore.load_scene('scenes/bike')"
    python -m benchmarks.against HEAD --devices intel pocl
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
SETUP = "import lfcore; scene = lfcore.load_scene('scenes/bike')"
STATEMENTS = [f"lfcore.render(scene, pixels=256, views={views})" for views in (4, 16, 64)]
WORKER = """
import os, sys, time
import lfcore
assert os.path.realpath(lfcore.__file__).startswith(os.getcwd()), "another checkout was imported"
names = {}
exec(sys.argv[1], names)
for statement in sys.stdin:
    begun = time.process_time()
    exec(statement, names)
    print(time.process_time() - begun, file=sys.stderr, flush=True)
"""


def worker(root: Path, setup: str, device: str) -> subprocess.Popen:
    """Start a process that imports the checkout ``root`` and has its own cache of programs."""
    environment = os.environ | {"PYTHONPATH": str(root), "XDG_CACHE_HOME": f"{root}/build/cache"}
    if device:
        environment["LFCORE_DEVICE"] = device
    return subprocess.Popen(
        [sys.executable, "-c", WORKER, setup], cwd=root, env=environment, text=True,
        stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
    )  # fmt: skip


def seconds(process: subprocess.Popen, statement: str) -> float:
    """Return the processor seconds of a statement in a worker."""
    assert process.stdin and process.stderr  # both are pipes
    print(statement, file=process.stdin, flush=True)
    said = ""
    for line in process.stderr:
        try:
            return float(line)
        except ValueError:  # a warning, or the first line of a traceback
            said += line
    sys.exit(f"{statement}\n{said}")


def compared(processes: list, statement: str, rounds: int) -> np.ndarray:
    """Return each worker's median of processor seconds, after a warm-up round."""
    times = [[seconds(process, statement) for process in processes] for _ in range(rounds + 1)]
    return np.median(times[1:], axis=0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("revision")
    parser.add_argument("statements", nargs="*", default=STATEMENTS)
    parser.add_argument("--setup", default=SETUP)
    parser.add_argument("--devices", nargs=2, default=["", ""], metavar="NAME")
    parser.add_argument("--rounds", type=int, default=8)
    options = parser.parse_args()
    git = ["git", "-C", str(ROOT), "worktree"]
    with tempfile.TemporaryDirectory() as folder:
        other = Path(folder) / "tree"
        subprocess.run([*git, "add", "--quiet", "--detach", other, options.revision], check=True)
        try:
            pairs = zip((other, ROOT), options.devices, strict=True)
            processes = [worker(root, options.setup, device) for root, device in pairs]
            for statement in options.statements:
                before, now = compared(processes, statement, options.rounds)
                print(f"{before:8.3f} s {now:8.3f} s {before / now:6.2f}  {statement}", flush=True)
            for process in processes:
                process.communicate()
        finally:
            subprocess.run([*git, "remove", "--force", other], check=True)


if __name__ == "__main__":
    main()
