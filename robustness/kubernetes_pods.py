"""profiles/kubernetes, up to the door of a cluster: its pods run as processes of this machine.

    python -m robustness.kubernetes_pods           (make pods)

In place of a cluster stands a server that takes as much of Kubernetes's interface as Snakemake's
plugin asks for.  It runs what each pod's container is told, in an empty folder with the pod's
environment and no other, against object storage on the loopback interface.  So the profile, the
secrets, the sources that travel through the storage, and each job's command are run for real;
scheduling, images and networks of a cluster are not.  Says whether the objects are those of a
run on this machine alone.  Skipped, aloud, where a package is missing.
"""

from __future__ import annotations

import base64
import json
import os
import re
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

from robustness import object_storage
from robustness.kills import copy_project, digests
from robustness.object_storage import KEPT, KEYS, client_of, objects, server, skipped
from robustness.outcome import ROOT

PACKAGES = ("snakemake_executor_plugin_kubernetes", *object_storage.PACKAGES)
PLACE = re.compile(r"/(?:api/v1|apis/batch/v1)/namespaces/default/(\w+)(?:/([\w-]+))?(?:/(\w+))?")
TARGET = "results/tables/index.html"
WORDS = ("--configfile", "micro.yaml", "--", TARGET)


@dataclass
class Pods:
    """What the server knows: secrets by name, and jobs with their processes."""

    folder: Path
    secrets: dict[str, dict] = field(default_factory=dict)
    jobs: dict[str, dict] = field(default_factory=dict)
    processes: dict[str, subprocess.Popen] = field(default_factory=dict)
    requests: list[dict] = field(default_factory=list)
    """What each container asked for."""

    def start(self, job: dict) -> None:
        """Run the container of a job: its command, its variables, an empty folder."""
        name = job["metadata"]["name"]
        (container,) = job["spec"]["template"]["spec"]["containers"]
        self.requests.append(container["resources"]["requests"])
        work = self.folder / name
        work.mkdir()
        environment = {"PATH": f"{Path(sys.executable).parent}:/usr/bin:/bin", "HOME": str(work)}
        environment |= {name: value for name, value in os.environ.items() if "PIP_" in name}
        environment["PIP_CONSTRAINT"] = str(ROOT / "constraints.txt")  # as the image has it
        for variable in container["env"]:
            secret = variable["valueFrom"]["secretKeyRef"]
            data = self.secrets[secret["name"]]["data"][secret["key"]]
            environment[variable["name"]] = base64.b64decode(data).decode()
        with (self.folder / f"{name}.log").open("wb") as log:
            self.processes[name] = subprocess.Popen(
                [*container["command"], *container["args"]],
                cwd=work, env=environment, stdout=log, stderr=subprocess.STDOUT,
            )  # fmt: skip
        self.jobs[name] = job

    def status(self, name: str) -> dict:
        code = self.processes[name].poll()
        state = "active" if code is None else "failed" if code else "succeeded"
        return self.jobs[name] | {"status": {state: 1}}

    def log(self) -> str:
        """What all pods said."""
        return "\n".join(file.read_text() for file in sorted(self.folder.glob("*.log")))


class Handler(BaseHTTPRequestHandler):
    """Answers of the interface; ``pods`` is set on the class."""

    pods: Pods

    def do_POST(self) -> None:
        body = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        kind = self._kind()[0]
        if kind == "secrets":
            self.pods.secrets[body["metadata"]["name"]] = body
        else:
            self.pods.start(body)
        self._answer(body)

    def do_GET(self) -> None:
        kind, name, _ = self._kind()
        # Without pods, Snakemake goes by the status of the job.
        self._answer(self.pods.status(name) if kind == "jobs" else {"items": []})

    def do_DELETE(self) -> None:
        self._answer({"status": "Success"})

    def _kind(self) -> tuple[str, ...]:
        found = PLACE.match(self.path)
        if not found:
            raise ValueError(self.path)
        return found.groups()

    def _answer(self, body: dict) -> None:
        data = json.dumps(body).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_) -> None:
        """Nothing on the terminal."""


@contextmanager
def cluster(folder: Path) -> Iterator[tuple[Pods, Path]]:
    """The server while the block lasts, and the configuration that leads to it."""
    folder.mkdir()
    pods = Pods(folder)
    served = ThreadingHTTPServer(("127.0.0.1", 0), type("OfPods", (Handler,), {"pods": pods}))
    threading.Thread(target=served.serve_forever, daemon=True).start()
    url = f"http://127.0.0.1:{served.server_address[1]}"
    known = {"name": "here", "cluster": {"server": url}}
    context = {"name": "here", "context": {"cluster": "here", "user": "me"}}
    config = folder / "kubeconfig"
    config.write_text(json.dumps({
        "apiVersion": "v1", "kind": "Config", "current-context": "here", "clusters": [known],
        "contexts": [context], "users": [{"name": "me", "user": {}}],
    }))  # fmt: skip
    try:
        yield pods, config
    finally:
        served.shutdown()
        served.server_close()
        for process in pods.processes.values():
            if process.poll() is None:
                process.kill()
                process.wait()


def checkout(folder: Path) -> Path:
    """The project in a folder of its own: what git knows of there travels to the pods."""
    folder.mkdir()
    copy_project(folder)
    for words in (("init", "--quiet"), ("add", "--all")):
        subprocess.run(["git", *words], cwd=folder, check=True)
    return folder


def through_pods(folder: Path, url: str, config: Path) -> tuple[int, str]:
    """Status and words of a run with the profile."""
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--workflow-profile", "profiles/kubernetes",
         "--storage-s3-endpoint-url", url, "--default-storage-prefix", "s3://pods/run",
         "--seconds-between-status-checks", "1", *WORDS],
        cwd=checkout(folder), env=os.environ | KEYS | {"KUBECONFIG": str(config)}, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout


def here(folder: Path) -> dict[str, str]:
    """Name and SHA-256 of results of a run on this machine alone."""
    subprocess.run(
        [sys.executable, "-m", "lfcore.workflow.run", "--cores", "2", *WORDS],
        cwd=checkout(folder), check=True, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT,
    )  # fmt: skip
    results = folder / "results"
    return digests((file for file in results.rglob("*") if file.name.endswith(KEPT)), results)


def main() -> int:
    if skipped(PACKAGES, "kubernetes,s3,dev"):
        return 0
    with tempfile.TemporaryDirectory() as name, server(Path(name)) as url:
        folder = Path(name)
        client = client_of(url)
        client.create_bucket(Bucket="pods")
        begun = time.monotonic()
        with cluster(folder / "cluster") as (pods, config):
            status, said = through_pods(folder / "run", url, config)
            log = pods.log()
        found, wanted = objects(client, "pods"), here(folder / "here")
    same = bool(wanted) and found == wanted
    print(f"{len(pods.requests)} pods in {time.monotonic() - begun:.0f} s: status {status}, "
          f"{len(found)} objects, {'identical' if same else 'DIFFERENT'}")  # fmt: skip
    if status or not same:
        print(said[-3000:], log[-3000:], sep="\n")
    return int(bool(status) or not same)


if __name__ == "__main__":
    sys.exit(main())
