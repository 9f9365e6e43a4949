"""Camera arrays, traced by us and by Mitsuba 3 in turn.

    python benchmarks/arrays.py --out arrays.csv
    python benchmarks/arrays.py --scenes book --cameras 8 --tile 128 --peers none --out arrays.csv

Arrays have 16 x 16 data cameras of 512 x 512 pixels, one ray per pixel, shaded with shadows, into
host memory that is reused, or new.
"""

import argparse
from functools import partial
from pathlib import Path

from benchmarks.measured.rows import in_turn, rates, report, say
from benchmarks.measured.sample import SCENES
from benchmarks.peers.method import Method, clocked
from benchmarks.peers.mitsuba_array import MitsubaArray
from benchmarks.tracer import skipping
from lfcore.opencl.device import open_device
from lfcore.optics.array import CameraArray
from lfcore.rendering.array import trace_array
from lfcore.rendering.prepared import open_tracer
from lfcore.scene.build import build_scene
from lfcore.workflow.studies import ARRAYS

RATIOS = {
    "ratio_to_mitsuba": "mrays_per_second",
    "core_ratio_to_mitsuba": "mrays_per_core_second",
}


def parse(arguments: list[str] | None = None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", nargs="+", default=["book", "sphere"], choices=list(ARRAYS))
    parser.add_argument("--cameras", type=int, default=16, help="per side; default 16")
    parser.add_argument("--tile", type=int, default=512, help="pixels per side; default 512")
    parser.add_argument("--peers", nargs="*", default=["mitsuba"], choices=["mitsuba", "none"])
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--out", type=Path, required=True, help="CSV file")
    options = parser.parse_args(arguments)
    if min(options.repeats, options.cameras - 1, options.tile) < 1:
        parser.error("--repeats and --tile must be at least 1, --cameras 2")
    return options


def traced(options: argparse.Namespace, name: str, device) -> list[dict]:
    """Rows of tracing one scene's array."""
    say(f"{name}: tracing {options.cameras}^2 cameras of {options.tile}^2 pixels")
    tracer = open_tracer(build_scene(SCENES / name), device)
    bounds, fov_deg = ARRAYS[name]["bounds_m"], ARRAYS[name]["fov_deg"]
    size = (options.cameras,) * 2, (options.tile,) * 2
    array = CameraArray.on_grid(size[0], bounds, fov_deg, size[1])
    made: dict = {}

    def ours():
        # Into the memory of the previous turn, as Mitsuba's allocator does.
        made["image"] = trace_array(tracer, array, out=made.get("image"))

    new = partial(trace_array, tracer, array)
    note = "the system gives new pages every time"
    methods = [
        Method("lfcore", "array", lambda: clocked(ours, array.rays)),
        Method("lfcore, new memory", "array", lambda: clocked(new, array.rays), note),
    ]
    peer = None
    if "mitsuba" in options.peers:
        with skipping("mitsuba"):
            opened = MitsubaArray(tracer.scene, device.threads)
            methods.append(opened.method(array))
            peer = opened
    runs = in_turn(methods, options.repeats)
    if peer is not None:
        peer.close()
    rows: list[dict] = [
        {"scene": name, "work": "array", "method": method.name, **rates(runs[method.name]),
         "note": method.note}
        for method in methods
    ]  # fmt: skip
    for row in rows:
        row["seconds"] = array.rays / row["mrays_per_second"] / 1e6
        if peer is not None:
            for ratio, rate in RATIOS.items():
                row[ratio] = row[rate] / rows[-1][rate]
    return rows


def main() -> None:
    options, device = parse(), open_device()
    report(options.out, lambda: [
        row for name in options.scenes for row in traced(options, name, device)
    ])  # fmt: skip


if __name__ == "__main__":
    main()
