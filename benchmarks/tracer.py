"""The tracer against its peers and against itself, in one run on one machine.

    python benchmarks/tracer.py --out tracer.csv
    python benchmarks/tracer.py --scenes bike --views 512 --peers embree --out bike.csv

Compared are visibility (closest triangle and depth of every ray) and Algorithm 1 (interpolated
normals, textures, Blinn-Phong, shadows, five sensor planes), ours and the peers' in turn on the
same sampled rays; see benchmarks/README.md for the columns and the rules.
"""

import argparse
import os
from pathlib import Path

from benchmarks.measured import compare
from benchmarks.measured.rows import print_table, say, write_csv
from lfcore.timing import machine


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["bike", "cabin", "bedroom"])
    parser.add_argument("--views", nargs="+", type=int, default=[16, 64, 512], help="N")
    parser.add_argument("--pixels", type=int, default=512, help="M; default 512")
    parser.add_argument(
        "--peers", nargs="*", default=list(compare.PEERS), choices=[*compare.PEERS, "none"]
    )
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--mrays", type=float, default=16.0, help="million rays to sample")
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    options = parser.parse_args(arguments)
    options.peers = [peer for peer in options.peers if peer != "none"]
    if options.repeats < 1:
        parser.error("--repeats must be at least 1")
    return options


def main() -> None:
    options = parse()
    here = machine()
    say(", ".join(f"{key} {value}" for key, value in here.items()))
    say(f"load of the machine over the last minute: {os.getloadavg()[0]:.1f}")
    rows = [
        {**row, "processor": here["processor"], "cores": here["cores"]}
        for row in compare.compare(options)
    ]
    write_csv(options.out, rows)
    print_table(
        rows, leave_out=("note", "processor", "cores", "threads", "sampled_rays", "repeats")
    )


if __name__ == "__main__":
    main()
