"""Poses of animated glTF against three.js: python -m benchmarks.poses --models FOLDER --out OUT.csv

Each file of ``poses.yaml`` is at 5 instants, where 20 of its corners must be in the same places.
"""

import argparse
import base64
import json
import os
import struct
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import yaml

from benchmarks.results import report, said
from lfcore.readers.meshes import read_mesh

LIST = Path(__file__).with_suffix(".yaml")
PROGRAM = Path(__file__).parent / "peers/poses.mjs"
CORNERS, BETWEEN = 20, 3
"""The corners, and the instants between the first and the last."""
GLB, LENGTHS = b"glTF", 12
"""The first bytes of a binary file, and the place of its first chunk's length."""


def bare(file: Path) -> dict[str, Any]:
    """Return a file's JSON with its buffers, but without materials and textures."""
    raw, chunk = file.read_bytes(), b""
    if raw[:4] == GLB:
        (length,) = struct.unpack_from("<I", raw, LENGTHS)
        raw, chunk = raw[20 : 20 + length], raw[28 + length :]
    tree = json.loads(raw)
    for buffer in tree["buffers"]:
        uri = buffer.get("uri", "")
        if not uri.startswith("data:"):
            data = (file.parent / uri).read_bytes() if uri else chunk
            code = base64.b64encode(data[: buffer["byteLength"]]).decode()
            buffer["uri"] = f"data:application/octet-stream;base64,{code}"
    for key in ("images", "textures", "samplers", "materials"):
        tree.pop(key, None)
    for mesh in tree["meshes"]:
        for primitive in mesh["primitives"]:
            primitive.pop("material", None)
    return tree


def compared(file: Path, node: Path, folder: Path) -> dict[str, Any]:
    """Return how far corners are apart, and how far they move, relative to the model's size."""
    plain, asked = folder / "bare.gltf", folder / "ask.json"
    plain.write_text(json.dumps(bare(file)))
    content, rng = read_mesh(plain), np.random.default_rng(1)
    assert content.animation is not None
    start, end, at = content.animation
    times = [start, *sorted((start + (end - start) * rng.random(BETWEEN)).tolist()), end]
    counts = np.array([part.count for part in content.parts])
    parts = rng.choice(len(counts), CORNERS, p=counts / counts.sum())
    corners = [(int(part), int(rng.integers(3 * counts[part]))) for part in parts]
    asked.write_text(json.dumps({"times": times, "corners": corners}))
    done = subprocess.run(
        ["node", PROGRAM, plain, asked], capture_output=True, text=True, check=True,
        env=os.environ | {"NODE_PATH": str(node)}, timeout=300,
    )  # fmt: skip
    theirs = np.array(json.loads(done.stdout))
    ours, size = [], 0.0
    for time in times:
        shown = [part.triangles.reshape(-1, 3) for part in at(time).parts]
        ours.append([shown[part][corner] for part, corner in corners])
        size = max(size, float(np.ptp(np.concatenate(shown), axis=0).max()))
    places = np.array(ours)
    return {
        "triangles": int(counts.sum()),
        "apart": f"{np.abs(places - theirs).max() / size:.1e}",
        "moved": f"{np.abs(places - places[0]).max() / size:.2f}",
    }


def main() -> None:
    parser = argparse.ArgumentParser("benchmarks.poses", description=__doc__.splitlines()[0])
    parser.add_argument("--models", type=Path, required=True, help="folder of repositories")
    parser.add_argument("--node", type=Path, required=True, help="folder node_modules with three")
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    rows = []
    with TemporaryDirectory() as folder:
        for name in yaml.safe_load(LIST.read_text()):
            found = compared(options.models / name, options.node, Path(folder))
            rows.append(said({"file": name} | found))
    three = json.loads((options.node / "three/package.json").read_text())["version"]
    report(options.out, "python -m benchmarks.poses", rows, note=f"three.js {three}.")


if __name__ == "__main__":
    main()
