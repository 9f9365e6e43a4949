"""All cases in the order of the report, which are run by name."""

from collections.abc import Iterable, Sequence

from lfcore.errors import did_you_mean
from lfcore.evaluation.stability import light, primitives
from lfcore.evaluation.stability.measurement import Case, Measurement, StabilityError
from lfcore.evaluation.stability.tested_tracer import TracerUnderTest
from lfcore.progress import Progress, silent

CASES: tuple[Case, ...] = (
    primitives.edge_rays, primitives.vertex_rays, primitives.any_vertex_rays,
    primitives.triangle_sizes, primitives.far_from_the_origin, primitives.long_rays,
    primitives.tiny_triangles, primitives.large_triangles,
    primitives.scaled_scene, primitives.far_sphere,
    primitives.needles, primitives.nearly_coplanar, primitives.grazing,
    primitives.axes, primitives.any_axes, primitives.flat_boxes,
    light.self_shadow, light.far_self_shadow, light.thin_gap, light.thin_gap_far,
    light.bright_texel, light.closed_room, light.albedo, light.slit, light.scaled_light,
)  # fmt: skip


def chosen(names: str | Iterable[str]) -> tuple[Case, ...]:
    """The cases of these names, or ``all``.

    Raises :class:`StabilityError` for a name that no case has.
    """
    known = {case.name: case for case in CASES}
    if names == "all":
        return CASES
    for name in names:
        if name not in known:
            raise StabilityError(
                f"no stability sweep is called {name!r}", key="analysis.stability_cases",
                remedy=did_you_mean(name, known),
            )  # fmt: skip
    return tuple(known[name] for name in names)


def run_all(
    tracer: TracerUnderTest, cases: Sequence[Case] = CASES, *, progress: Progress = silent
) -> list[Measurement]:
    """Measurements of these cases; ``progress(done, total)`` counts cases."""
    made: list[Measurement] = []
    for number, case in enumerate(cases, 1):
        made.extend(case(tracer))
        progress(number, len(cases))
    return made
