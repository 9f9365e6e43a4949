"""The stability sweeps: their errors by hand, their naive methods, and the tracer's verdicts."""

import dataclasses
import math

import numpy as np
import pytest
from scattered_planes import form_plane

from lfcore import DeviceError, SceneError, StorageError
from lfcore.evaluation.stability import light, measurement, naive, primitives, shapes, tested_tracer
from lfcore.evaluation.stability.measurement import (
    LIMITS,
    RIGHT,
    Measurement,
    StabilityError,
    check_passed,
    measured,
)
from lfcore.evaluation.stability.report import CASES
from lfcore.oracle.intersect import closest_hits
from lfcore.oracle.slab import all_pixels, slab_hits, trace
from lfcore.tracing.bvh import build_bvh
from lfcore.tracing.tracer import Tracer

pytestmark = pytest.mark.slow


class Oracle(tested_tracer.TracerUnderTest):
    def closest(self, triangles, origins, directions):
        hits = closest_hits(triangles, origins, directions)
        return hits.triangle, np.float32(hits.t)

    any_closest = closest

    def slab_hits(self, triangles, slab, pixels):
        hits = slab_hits(tested_tracer.bare_scene(triangles), slab, pixels)
        shape = len(pixels), slab.views, slab.views
        return hits.triangle.reshape(shape), np.float32(hits.t.reshape(shape))

    def picture(self, scene, slab, plane):
        size, views = slab.pixels, slab.views
        light = trace(scene, slab, all_pixels(slab)).reshape(size, size, views, views, 3)
        return form_plane(slab, plane, light)


ORACLE = Oracle(None, rays=300)


@pytest.fixture(scope="module")
def tracer():
    return tested_tracer.TracerUnderTest(rays=300)


def test_verdicts():
    def verdict(error, **options):
        return Measurement("case", "parameter", 1.0, 2.0, error, 0.5, **options).verdict

    assert verdict(0.5) == "pass" and verdict(0.6) == "fail"
    assert verdict(math.nan) == "fail" and verdict(math.inf) == "fail"
    small = "3 triangles were left out: too small"
    assert verdict(math.nan, limit="small triangles", said=small) == "refused"
    # Within all limits; for another reason; beyond a limit, but computed.
    assert verdict(math.nan, said=small) == "fail"
    assert verdict(math.nan, limit="coordinates", said=small) == "fail"
    assert verdict(0.1, limit="coordinates") == "fail"


def test_rows_that_fail_are_an_error_that_names_them():
    good, bad = (Measurement("case", "p", value, 2.0, value, 0.5) for value in (0.5, 0.75))
    check_passed([good])
    with pytest.raises(StabilityError, match=r"1 rows .* case, p = 0\.75: error 0\.75, bound 0\.5"):
        check_passed([good, bad])


def test_only_a_scene_is_refused():
    def raising(error):
        def work():
            raise error

        return measured("case", RIGHT, lambda: 1.0, work, limit="coordinates")

    assert raising(SceneError("3 triangles are out of range")).verdict == "refused"
    assert raising(SceneError("no such texture")).verdict == "fail"
    for error in (DeviceError("out of range"), StorageError("out of range"), ZeroDivisionError()):
        with pytest.raises(type(error)):
            raising(error)


def test_naive_closest_hit_is_right_where_nothing_is_stiff():
    mesh = np.float32(shapes.soup(300))
    rays = shapes.random_rays(500)
    hits = closest_hits(mesh, *rays, near=2000)
    found = naive.moeller_trumbore(mesh, *rays)
    assert (found[0] >= 0).mean() > 0.3 and hits.clear(1000).mean() > 0.5
    assert measurement.mismatches(found, hits, 1000) == 0
    assert naive.moeller_trumbore(mesh[:0], *rays)[0].tolist() == [-1] * 500


@pytest.mark.parametrize("case", [primitives.vertex_rays, primitives.axes, primitives.flat_boxes])
def test_the_oracle_passes_its_own_cases(case):
    """A case that the truth fails asks for something else than the truth."""
    rows = list(case(ORACLE))
    assert len(rows) >= 2 and all(row.verdict == "pass" for row in rows)


def test_a_tracer_that_loses_rays_fails():
    class Lossy(Oracle):
        def closest(self, *rays):
            number, t = super().closest(*rays)
            number[::50] = -1
            return number, t

    assert all(row.verdict == "fail" for row in primitives.axes(Lossy(None)))


def test_naive_methods_fail_where_the_cases_say():
    """Or the sweeps would not reach the stiff range."""
    vertex = list(primitives.vertex_rays(ORACLE))
    assert max(row.naive_error for row in vertex) > 0.01
    assert max(row.naive_error for row in primitives.axes(ORACLE)) > 0.1
    for case in (light.thin_gap, light.thin_gap_far):
        assert max(row.naive_error for row in case(ORACLE)) > 0.1


def test_rays_of_any_direction_hold_for_needles_and_scales():
    class General(tested_tracer.TracerUnderTest):
        def closest(self, *rays):
            return self.any_closest(*rays)

    general = General(rays=300)
    rows = [*primitives.needles(general), *primitives.tiny_triangles(general)]
    rows += primitives.scaled_scene(general)
    assert [row for row in rows if row.verdict == "fail"] == []


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.__name__)
def test_the_tracer_holds(case, tracer):
    """Every case of the report, and none besides: a row that is refused says which limit."""
    rows = list(case(tracer))
    check_passed(rows)
    assert all(row.number and row.unit and row.bound_from for row in rows)
    assert [row for row in rows if row.verdict == "pass"], "a case of refusals tests nothing"
    assert {row.limit for row in rows} - {""} <= set(LIMITS)


def test_scenes_beyond_the_range_of_float32_are_refused(tracer):
    rows = list(primitives.scaled_scene(tracer))
    assert {row.value for row in rows if row.verdict == "pass"} == {
        10.0**k for k in (12, 9, 6, 3, -3, -6, -9, -10)
    }
    refused = {row.limit for row in rows if row.verdict == "refused"}
    assert refused == {"coordinates", "small triangles"}
    tiny = tested_tracer.bare_scene(np.full((1, 3, 3), 1e-13, np.float32))
    with pytest.raises(SceneError, match="too small for float32"):
        Tracer(tiny, build_bvh(np.zeros((0, 3, 3))))


def test_a_loader_that_rounds_before_it_subtracts_fails(monkeypatch):
    """The case far from the origin goes through the loader, not past it."""
    from lfcore.scene import assemble

    moved = assemble.SurfaceMesh.transformed

    def rounded(part, matrix):
        near = moved(part, np.eye(4))
        return moved(dataclasses.replace(near, triangles=np.float32(near.triangles)), matrix)

    monkeypatch.setattr(assemble.SurfaceMesh, "transformed", rounded)
    rows = list(primitives.far_from_the_origin(dataclasses.replace(ORACLE, rays=200)))
    assert [row.verdict for row in rows][:1] == ["pass"]
    assert {row.verdict for row in rows if row.value >= 1e3} == {"fail"}
