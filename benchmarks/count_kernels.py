"""How much there is to read in the tracer's kernels.

    python benchmarks/count_kernels.py        (make count)

Prints lines, conditionals of the preprocessor, names that the host defines, lines over 100 columns,
functions of eight and more parameters, and the files that lie on the way of a block from
``Tracer.trace_tile`` to its colours.
"""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
HOST = ROOT / "lfcore" / "tracing"
KERNELS = HOST / "kernels"
MOST_COLUMNS = 100
MANY = 8
WAY = (
    "tracer.py", "plan.py", "tile.py", "device_scene.py", "entry/slab.cl", "entry/pipeline.cl",
    "traversal/packet.cl", "coverage/visibility.cl", "coverage/depth_buffer.cl",
    "coverage/triangles.cl", "coverage/regions.cl", "surface/samples.cl", "shadows/shadows.cl",
    "shading/shade.cl",
)  # fmt: skip
"""In the order in which a block passes them; each is named by its stage."""


def sources() -> dict[Path, str]:
    """Every kernel file with its text."""
    return {path: path.read_text(encoding="ascii") for path in sorted(KERNELS.rglob("*.cl"))}


def parameters(text: str) -> list[tuple[str, int]]:
    """Functions of a file that are no kernels, with how many parameters each has."""
    found = re.findall(r"^inline [^;{=]*?(\w+)\(([^{;]*?)\)\s*\{", text, re.MULTILINE)
    return [(name, within.count(",") + 1) for name, within in found]


def defines() -> list[str]:
    """Names that programs are built with, as the host's sources have them."""
    host = "\n".join(path.read_text(encoding="utf-8") for path in sorted(HOST.glob("*.py")))
    named = set(re.findall(r'"([A-Z][A-Z_]+)":', host)) | {"LANES"}
    return sorted(named)


def counts() -> dict[str, int]:
    """The figures, by name."""
    texts = sources()
    lines = [line for text in texts.values() for line in text.splitlines()]
    missing = [name for name in WAY if not any((f / name).is_file() for f in (HOST, KERNELS))]
    if missing:
        raise SystemExit(f"not on the way of a block any more: {', '.join(missing)}")
    many = [name for text in texts.values() for name, count in parameters(text) if count >= MANY]
    return {
        "files": len(texts),
        "lines": len(lines),
        "conditionals": sum(bool(re.match(r"\s*#\s*if", line)) for line in lines),
        "of these include guards": sum("#ifndef LFCORE_" in text for text in texts.values()),
        "host defines": len(defines()),
        f"lines over {MOST_COLUMNS} columns": sum(len(line) > MOST_COLUMNS for line in lines),
        f"functions of {MANY} and more parameters": len(many),
        "files to follow a block": len(WAY),
    }


def main() -> None:
    for name, count in counts().items():
        print(f"{count:6}  {name}")
    print("defines:", ", ".join(defines()))
    print("the way of a block:", ", ".join(WAY))


if __name__ == "__main__":
    main()
