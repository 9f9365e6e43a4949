"""Cycles per ray of each part of Algorithm 1, and the processor's peaks.

A part's cycles are the difference to a run without it.  Cycles are CPU time, which other programs
on the machine disturb little.
"""

import itertools
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.measured import ours
from benchmarks.measured.rows import in_turn, print_table, rates, say
from benchmarks.measured.sample import sample_slab
from benchmarks.measured.scenes import Loaded
from benchmarks.peers.method import clocked
from lfcore.opencl.device import Device, cl
from lfcore.optics.slab import Slab
from lfcore.tracing.tracer import Tracer

PEAKS = Path(__file__).with_name("peaks.cl")
CHAIN_LATENCY = 4
"""The cycles of a dependent fused multiply-add on Intel since Skylake and AMD since Zen 2."""


def _best(device: Device, launch, repeats: int) -> tuple[float, float]:
    """The least wall and CPU seconds of a launch."""

    def work() -> None:
        launch()
        device.queue.finish()

    runs = [clocked(work, 0) for _ in range(repeats + 1)]
    return min(run.seconds for run in runs), min(run.cpu_seconds for run in runs)


def peaks(device: Device, repeats: int) -> dict[str, float]:
    """The device's peaks: clock, flops and bytes per second; per core from CPU time."""
    program = cl.Program(device.context, PEAKS.read_text(encoding="ascii")).build()
    chain, flops, stream = (cl.Kernel(program, name) for name in ("chain", "flops", "stream"))
    size = (device.threads,)
    head = np.array([0.5, 0.5, *np.zeros(device.threads)], np.float32)
    flags = cl.mem_flags.READ_WRITE | cl.mem_flags.COPY_HOST_PTR
    x = cl.Buffer(device.context, flags, hostbuf=head)
    steps = np.int32(20_000_000)
    _, cpu = _best(device, lambda: chain(device.queue, (1,), (1,), x, steps), repeats)
    clock = float(steps) * CHAIN_LATENCY / cpu
    wall, cpu = _best(device, lambda: flops(device.queue, size, (1,), x, steps), repeats)
    work = float(steps) * 12 * 16 * 2 * device.threads
    out = {
        "clock_ghz": clock / 1e9,
        "gflops": work / wall / 1e9,
        "gflops_per_core": work / cpu / 1e9,
        "flops_per_cycle": work / cpu / clock,
    }
    for name, words, times in (("memory", 64 << 20, 1), ("cache", 64 << 10, 2000)):
        data = device.buffer(np.zeros(words * device.threads, np.float32))
        arguments = data, x, np.int32(words), np.int32(times)
        launch = lambda a=arguments: stream(device.queue, size, (1,), *a)  # noqa: E731
        wall, cpu = _best(device, launch, repeats)
        count = 4.0 * words * times * device.threads
        out[f"{name}_gbytes"] = count / wall / 1e9
        out[f"{name}_bytes_per_cycle"] = count / cpu / clock
    return out


def _measured(loaded, sample, repeats: int, ghz: float) -> dict[str, float]:
    """The cycles per ray of every variant of the program."""
    tracer, planes = loaded.tracer, ours.planes_of(loaded.scene)
    lights = [replace(light, casts_shadows=False) for light in loaded.scene.lights]
    dark = Tracer(replace(loaded.scene, lights=lights), loaded.bvh, tracer.device)
    methods = {"visibility": ours.visibility(tracer, sample)}
    methods["all"] = ours.algorithm1(tracer, sample, planes)
    methods["no planes"] = ours.algorithm1(tracer, sample, [])
    methods["no shadows"] = ours.algorithm1(dark, sample, [])
    for name, method in methods.items():
        method.name = name
    runs = in_turn(list(methods.values()), repeats)
    return {name: ghz * 1e3 / rates(one)["mrays_per_core_second"] for name, one in runs.items()}


def roofline(options) -> list[dict]:
    """Rows of (part, cycles per ray); the peaks are in every row and are printed once."""
    rows: list[dict] = []
    peak: dict[str, float] = {}
    scenes = map(Loaded.open, options.scenes)
    for loaded, views in itertools.product(scenes, options.angular):
        say(f"{loaded.name}, N = {views}")
        sample = sample_slab(Slab(loaded.scene.camera, views, options.size), options.mrays)
        if not peak:
            peak = peaks(loaded.tracer.device, options.repeats)
            print_table([peak])
        took = _measured(loaded, sample, options.repeats, peak["clock_ghz"])
        parts = {"visibility": took["visibility"]}
        parts["shading"] = took["no shadows"] - took["visibility"]
        parts["shadows"] = took["no planes"] - took["no shadows"]
        parts["planes"] = took["all"] - took["no planes"]
        for part, cycles in [*parts.items(), ("whole Algorithm 1", took["all"])]:
            rows.append({
                "scene": loaded.name,
                "triangles": loaded.scene.triangle_count,
                "N": views,
                "M": options.size,
                "work": "algorithm1",
                "part": part,
                "cycles_per_ray": cycles,
                "share": cycles / took["all"],
                "flops_possible_per_ray": cycles * peak["flops_per_cycle"],
                "bytes_possible_per_ray": cycles * peak["memory_bytes_per_cycle"],
                **peak,
            })  # fmt: skip
    return rows
