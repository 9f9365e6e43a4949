"""Take the steps of workflow/envs/Containerfile without a container: python3 container.py PROJECT

For a root folder that is thrown away afterwards (make bare STEPS=container).  In place of the
image that it begins with: this Python, in a virtual environment.
"""

import json
import os
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

TRIED = ["--configfile", "config/smoke.yaml", "--", "results/tables/"]
"""What the container is asked for."""


def instructions(file: Path) -> list[tuple[str, str]]:
    """Instruction and what follows it, line by line."""
    lines = file.read_text().replace("\\\n", " ").splitlines()
    words = [line.split(None, 1) for line in lines if line.strip() and not line.startswith("#")]
    return [(name, rest) for name, rest in words]


def copy(project: Path, words: list[str], to: Path) -> None:
    """As COPY does: what a folder holds, files as they are."""
    *sources, name = words
    place = to / name
    for source in (project / one for one in sources):
        if source.is_dir():
            shutil.copytree(source, place, dirs_exist_ok=True)
        else:
            place.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, place)


def main(project: Path) -> None:
    venv = Path("/venv")
    subprocess.run([sys.executable, "-m", "venv", str(venv)], check=True)
    environment = os.environ | {"PATH": f"{venv}/bin:{os.environ['PATH']}"}
    here, entry = Path("/"), []
    for name, rest in instructions(project / "workflow" / "envs" / "Containerfile"):
        print(name, rest, flush=True)
        if name == "WORKDIR":
            here = Path(rest)
            here.mkdir(parents=True, exist_ok=True)
        elif name == "COPY":
            copy(project, shlex.split(rest), here)
        elif name == "RUN":
            subprocess.run(rest, shell=True, cwd=here, env=environment, check=True)
        elif name == "ENV":
            environment |= dict(word.split("=", 1) for word in shlex.split(rest))
        elif name == "ENTRYPOINT":
            entry = json.loads(rest)
        elif name not in ("FROM", "CMD"):
            sys.exit(f"container.py: takes no {name}")
    subprocess.run([*entry, *TRIED], cwd=here, env=environment, check=True)
    assert (here / "results" / "tables" / "index.html").stat().st_size


if __name__ == "__main__":
    main(Path(sys.argv[1]))
