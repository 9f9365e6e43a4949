"""How long a light field takes on so many cores: a model of the workflow's stages.

The stages follow each other: the plan, the scene, the tracing of all batches, the join of their
segments with the sum of their parts of the planes, and, where it is asked for, the planes from
the stored video.  What each takes is given by rates that were measured; the cut into jobs is the
workflow's own (:mod:`lfcore.workflow.costs`).
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

from lfcore.workflow import costs

LONGEST_POLL, POLL_STEP = 180.0, 10.0
"""Seconds: Snakemake asks SLURM's queue ever later while nothing ends (its plugin, 2.8)."""
SUM_BYTES = 24
"""Of a pixel of a sensor plane while it is summed: three colours of 8 bytes."""


@dataclass(frozen=True)
class Rates:
    """Of one scene and N, on one core: what a ray costs.

    ``blur`` is how much wider than the tile its part of the planes is, as a share of the picture's
    side; ``planes`` how many there are.
    """

    trace_ns: float
    encode_ns: float
    bytes_a_ray: float
    blur: float
    planes: int
    retrieve_ns: float = 0.0

    @property
    def ray_s(self) -> float:
        """Core seconds of a ray, traced and encoded."""
        return (self.trace_ns + self.encode_ns) * 1e-9


@dataclass(frozen=True)
class Overheads:
    """What the workflow costs beside the rays: core seconds, which are wall seconds of a free core.

    Attributes
    ----------
    plan_s, plan_job_s : Snakemake's start, and what each job adds to it.
    start_s : of a job: its process, packages, device, scene and programs.
    scene_s : both jobs of a scene, parsing and its tree.
    close_s : the job that joins and sums, without rays.
    submission_s : of a submission: two starts of Snakemake on the node.
    submit_s : of the submitting node for a submission; one after the other.
    queue_s : a submission waits so long where a place is free.
    poll_s : seconds before the queue is asked first.
    join_bytes_s, sum_bytes_s : bytes a core second.
    picture_ns : of a pixel of a plane that is made a picture of, and written.
    storage_bytes_s : bytes a second of the storage that all nodes share, for all of them together.
    """

    plan_s: float
    plan_job_s: float
    start_s: float
    scene_s: float
    close_s: float
    submission_s: float
    submit_s: float
    queue_s: float
    poll_s: float
    join_bytes_s: float
    sum_bytes_s: float
    picture_ns: float
    storage_bytes_s: float


@dataclass(frozen=True)
class Recording:
    """A light field of so many rays and N = ``views``, recorded by so many jobs.

    :func:`planned` cuts it as the workflow does.
    """

    rays: float
    views: int
    batches: int

    @property
    def pixels(self) -> float:
        """M, which need not be whole."""
        return math.sqrt(self.rays) / self.views


@dataclass(frozen=True)
class Estimate:
    """Wall seconds of each stage in order, and core seconds of all."""

    stages: dict[str, float]
    core_seconds: float
    bound: str
    """What would have to change for the run to be shorter."""

    @property
    def seconds(self) -> float:
        return sum(self.stages.values())


def planned(rays: float, views: int, minutes: float) -> Recording:
    """A light field cut into jobs of about ``minutes`` each."""
    seconds = rays * costs.nanoseconds_a_ray(views) * 1e-9
    return Recording(rays, views, costs.batch_count(seconds, minutes))


def estimate(
    field: Recording,
    rates: Rates,
    overheads: Overheads,
    cores: int,
    *,
    submitted: bool,
    retrieved: bool = False,
) -> Estimate:
    """What a run of ``field`` takes on ``cores``, each a place for one job.

    ``submitted`` is through SLURM, where the scene, each batch, and the join with the sum are a
    submission each; else all jobs are processes of one machine.  ``retrieved``: also the planes
    from the stored video, by one job of two cores.
    """
    o, count = overheads, field.batches
    job = o.start_s + field.rays * rates.ray_s / count
    join, add = join_and_sum(field, rates, o)
    closing = o.close_s + join + add
    stored = field.rays * rates.bytes_a_ray / o.storage_bytes_s
    plan = o.plan_s + o.plan_job_s * (count + 3)
    retrieve = o.start_s + field.rays * rates.retrieve_ns * 1e-9 if retrieved else 0.0
    core = plan + o.scene_s + count * job + closing + retrieve
    if submitted:
        core += (count + 2) * (o.submission_s + o.submit_s)
        beside = o.submission_s + o.queue_s
        scene = seen([o.submit_s + beside + o.scene_s], o.poll_s)
        traced = seen(finished(count, job + beside, cores, o.submit_s), o.poll_s)
        closed = seen([o.submit_s + beside + closing], o.poll_s)
    else:
        scene, traced, closed = o.scene_s, finished(count, job, cores, 0.0)[-1], closing
    stages = {"plan": plan, "scene": scene, "trace": max(traced, stored)}
    stages["join and sum"] = max(closed, 2 * stored)
    if retrieved:
        stages["retrieve"] = retrieve / min(cores, 2)
    longest = max(stages, key=lambda name: stages[name])
    if longest == "trace":
        bound = "storage" if traced <= stored else _tracing_bound(field, job, cores, o, traced)
    else:
        closed_by = max((join, "one join"), (add, "one sum"), (2 * stored, "storage"))[1]
        bounds = {"join and sum": closed_by, "retrieve": "one decoder"}
        bound = bounds.get(longest, "Snakemake")
    return Estimate(stages, core, bound)


def join_and_sum(field: Recording, rates: Rates, overheads: Overheads) -> tuple[float, float]:
    """Core seconds of the join of all segments, and of what all parts of the planes come to.

    A batch is a band of rows: its part is as wide as the picture, and as high as the band and
    its blur.
    """
    join = field.rays * rates.bytes_a_ray / overheads.join_bytes_s
    height = min(1.0, 1 / field.batches + rates.blur)
    pixels = field.pixels**2 * rates.planes
    add = field.batches * pixels * height * SUM_BYTES / overheads.sum_bytes_s
    return join, add + pixels * overheads.picture_ns * 1e-9


def finished(count: int, seconds: float, cores: int, gap: float) -> list[float]:
    """When each of ``count`` equal jobs ends, ascending; one is handed in every ``gap``."""
    free = [0.0] * min(cores, count)
    ends = []
    for place in range(count):
        begin = max(heapq.heappop(free), (place + 1) * gap)
        heapq.heappush(free, begin + seconds)
        ends.append(begin + seconds)
    return sorted(ends)


def seen(ends: Sequence[float], first: float) -> float:
    """When the last of ``ends`` (ascending) is noticed by Snakemake, which asks now and then.

    It asks after ``first`` seconds; where nothing has ended since, ten seconds later than the
    time before, three minutes at most; else after ``first`` again.
    """
    now = interval = first
    known = 0
    while True:
        done = known
        while done < len(ends) and ends[done] <= now:
            done += 1
        if done == len(ends):
            return now
        interval = first if done > known else min(interval + POLL_STEP, LONGEST_POLL)
        known = done
        now += interval


def _tracing_bound(
    field: Recording, job: float, cores: int, overheads: Overheads, traced: float
) -> str:
    """What tracing waits for where it is not storage."""
    at_once = finished(field.batches, job, cores, 0.0)[-1]
    if traced > 1.25 * at_once and field.batches * overheads.submit_s > job:
        return "submitting"
    return "cores" if field.batches > cores else "length of a job"
