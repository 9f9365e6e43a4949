"""The kernels' size, for a reader: python benchmarks/count_kernels.py (make count).

The way of one block through them is in docs/architecture.md.
"""

import re
from pathlib import Path

from lfcore.tracing.layouts import SINKS

TRACING = Path(__file__).resolve().parents[1] / "lfcore" / "tracing"
MOST_COLUMNS, MOST_LINES, MOST_PARAMETERS = 100, 50, 7
FUNCTION = re.compile(
    r"^(?:inline|KERNEL|kernel) [^;{=]*?\w+\(([^{;]*?)\)\s*\{(?:.*?\n\}| .*?\}$)",
    re.MULTILINE | re.DOTALL,
)


def defines() -> list[str]:
    """Names that programs are built with, as the host's sources have them."""
    texts = (path.read_text(encoding="utf-8") for path in TRACING.glob("*.py")
             if path.name != "layouts.py")  # fmt: skip
    found = {"LANES"}.union(*(re.findall(r'"([A-Z][A-Z_]+)": ', text) for text in texts))
    return sorted(found - SINKS.keys())


def main() -> None:
    texts = [path.read_text(encoding="ascii") for path in (TRACING / "kernels").rglob("*.cl")]
    lines = [line for text in texts for line in text.splitlines()]
    found = [one for text in texts for one in FUNCTION.finditer(text)]
    long = sum(one[0].count("\n") >= MOST_LINES for one in found)
    wide = sum(one[1].count(",") >= MOST_PARAMETERS for one in found)
    counts = {
        "kernel files": len(texts),
        "kernel lines": len(lines),
        "conditionals": sum(bool(re.match(r"\s*#\s*if", line)) for line in lines),
        "host defines": len(defines()),
        f"lines over {MOST_COLUMNS} columns": sum(len(line) > MOST_COLUMNS for line in lines),
        f"functions over {MOST_LINES} lines": long,
        f"functions over {MOST_PARAMETERS} parameters": wide,
    }
    for name, count in counts.items():
        print(f"{count:6}  {name}")
    print("defines:", ", ".join(defines()))


if __name__ == "__main__":
    main()
