"""The cost of storing a light field, beside its parts: python benchmarks/store.py --out FILE.csv

Tracing and encoding against the encoder alone, retrieval of 10 and 100 planes against decoding
alone, memory over N, and random access.  Every row that has a ``limit`` says whether it ``holds``.
"""

import argparse
import os
import tempfile
from pathlib import Path

from benchmarks.measured import stored, stored_files
from benchmarks.measured.rows import print_table, say, write_csv
from benchmarks.measured.scenes import Loaded
from lfcore.timing import machine

PARTS = ("encode", "retrieve", "memory", "access")


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom"])
    parser.add_argument("--angular", nargs="+", type=int, default=[512], help="N of the speeds")
    parser.add_argument("--size", type=int, default=512, help="M of the speeds; default 512")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--parts", nargs="+", default=PARTS, choices=PARTS)
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    options = parser.parse_args(arguments)
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    if "access" in options.parts and "memory" not in options.parts:
        parser.error("random access reads the files that the part 'memory' writes")
    return options


def main() -> None:
    options = parse()
    say(", ".join(f"{key} {value}" for key, value in machine().items()))
    say(f"load of the machine over the last minute: {os.getloadavg()[0]:.1f}")
    rows: list[dict] = []
    if {"encode", "retrieve"} & set(options.parts):
        for name in options.scenes:
            rows += speeds(name, options)
    with tempfile.TemporaryDirectory() as folder:
        if "memory" in options.parts:
            rows += stored_files.memory(options.scenes[0], Path(folder))
        if "access" in options.parts:
            rows += stored_files.random_access(options.scenes[0], Path(folder))
    for part in dict.fromkeys(row["part"] for row in rows):
        print_table([row for row in rows if row["part"] == part], leave_out=("part",))
    write_csv(options.out, rows)
    say(f"wrote {options.out}")


def speeds(name: str, options: argparse.Namespace) -> list[dict]:
    loaded, rows = Loaded.open(name), []
    for views in options.angular:
        say(f"{name}, N = {views}")
        with tempfile.TemporaryDirectory() as folder:
            store = stored.sample_store(loaded, views, options.size, Path(folder))
            if "encode" in options.parts:
                rows += stored.together(loaded, store, options.repeats)
            if "retrieve" in options.parts:
                rows += stored.retrieval(loaded, store, options.repeats)
    return rows


if __name__ == "__main__":
    main()
