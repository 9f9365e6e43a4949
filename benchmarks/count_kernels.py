"""How much there is to read in the tracer's kernels."""

import re
from pathlib import Path

from lfcore.tracing.layouts import SINKS

TRACING = Path(__file__).resolve().parents[1] / "lfcore" / "tracing"
MOST_COLUMNS, MOST_LINES, MOST_PARAMETERS = 100, 50, 7


def functions(text: str) -> list[tuple[int, int]]:
    """The numbers of parameters and of lines of each function of a file."""
    pattern = r"^(?:inline|KERNEL|kernel) [^;{=]*?\w+\(([^{;]*?)\)\s*\{(?: [^\n]*\}$|.*?\n\})"
    found = re.finditer(pattern, text, re.MULTILINE | re.DOTALL)
    return [(m[1].count(",") + 1, m[0].count("\n") + 1) for m in found]


def defines() -> list[str]:
    """Names that programs are built with, as the host's sources have them."""
    texts = (path.read_text(encoding="utf-8") for path in TRACING.glob("*.py")
             if path.name != "layouts.py")  # fmt: skip
    found = {"LANES"}.union(*(re.findall(r'"([A-Z][A-Z_]+)": ', text) for text in texts))
    return sorted(found - SINKS.keys())


def main() -> None:
    texts = [path.read_text(encoding="ascii") for path in TRACING.rglob("*.cl")]
    lines = [line for text in texts for line in text.splitlines()]
    found = [one for text in texts for one in functions(text)]
    counts = {
        "kernel files": len(texts),
        "kernel lines": len(lines),
        "conditionals": sum(bool(re.match(r"\s*#\s*if", line)) for line in lines),
        "host defines": len(defines()),
        f"lines over {MOST_COLUMNS} columns": sum(len(line) > MOST_COLUMNS for line in lines),
        f"functions over {MOST_LINES} lines": sum(length > MOST_LINES for _, length in found),
        f"functions over {MOST_PARAMETERS} parameters": sum(n > MOST_PARAMETERS for n, _ in found),
    }
    for name, count in counts.items():
        print(f"{count:6}  {name}")
    print("defines:", ", ".join(defines()))


if __name__ == "__main__":
    main()
