"""Realistic lenses: against paraxial optics, symmetry and energy."""

import numpy as np
import pytest

from lfcore.errors import OpticsError
from lfcore.optics.lens_system import LensSampler, LensSystem

# A symmetric biconvex singlet of index 1.5 with a stop behind it.
SINGLET = """# radius thickness index diameter
50   4   1.5  20
-50  2   1    20
0    45  0    {stop}
"""


@pytest.fixture
def make(tmp_path):
    def build(text=None, stop=4):
        path = tmp_path / "lens.dat"
        path.write_text(text if text is not None else SINGLET.format(stop=stop))
        return LensSystem.read(path)

    return build


def test_focal_length_is_the_lens_makers(make):
    thick = 0.5 * (2 / 0.05 - 0.5 * 4e-3 / (1.5 * 0.05**2))
    assert make().focal_length_m == pytest.approx(1 / thick, rel=1e-12)


@pytest.mark.parametrize("distance", [0.3, 1.0, 6.8, 1e4, np.inf])
def test_narrow_rays_meet_at_the_focus(make, distance):
    """With a small stop, rays from the film's middle cross the axis where it is focused."""
    lens = make(stop=0.2).focused(distance)
    reach = np.linspace(-9e-5, 9e-5, 5)[[0, 1, 3, 4]]
    rear = np.stack([reach, 0 * reach, np.full(4, lens.film_distance_m)], 1)
    origins, directions, alive = lens.trace(np.zeros((4, 3)), rear)
    assert alive.all()
    if np.isinf(distance):
        np.testing.assert_allclose(directions[:, 0] / directions[:, 2], 0, atol=1e-7)
    else:
        cross = origins[:, 2] - origins[:, 0] * directions[:, 2] / directions[:, 0]
        np.testing.assert_allclose(cross, distance, rtol=2e-3 * max(1, distance))


def test_the_stop_blocks(make):
    wide, narrow = (make(stop=stop).axial_pupil_area() for stop in (8, 4))
    assert wide / narrow == pytest.approx(4, rel=0.05)
    assert make(stop=8).stopped_down(4e-3).axial_pupil_area() == pytest.approx(narrow, rel=1e-9)
    with pytest.raises(OpticsError, match="wider"):
        make(stop=4).stopped_down(1.0)


def test_pupil_sampling_misses_nothing(make):
    """Sampling the bounds and sampling the whole rear plane estimate the same light."""
    lens = make(stop=6).focused(3.0)
    sampler = LensSampler(lens, 0.0175)
    rng = np.random.default_rng(1)
    for r in (0.0, 0.006, 0.014):
        film = np.repeat([[r * 0.6, r * 0.8]], 20000, 0)
        weights = sampler.rays(film, rng.random((20000, 2)))[2]
        rear = np.concatenate([rng.uniform(-0.015, 0.015, (40000, 2)), np.zeros((40000, 1))], 1)
        rear[:, 2] = lens.film_distance_m
        start = np.concatenate([np.repeat(film[:1], 40000, 0), np.zeros((40000, 1))], 1)
        towards = rear - start
        slope = towards[:, 2] / np.linalg.norm(towards, axis=1)
        passed = lens.trace(start, towards)[2]
        expected = np.mean(passed * slope**4) * 0.03**2 / lens.axial_pupil_area()
        assert weights.mean() == pytest.approx(expected, rel=0.05)
        if r == 0:
            assert weights.mean() == pytest.approx(1, rel=0.03)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1 2 3\n", "line 1"),
        ("# nothing\n", "no surface"),
        ("50 4 x 20\n", "not four numbers"),
        ("50 4 1.5 -3\n", "not positive"),
    ],
)
def test_bad_lens_files(make, text, words):
    with pytest.raises(OpticsError, match=words) as caught:
        make(text)
    assert "lens.dat" in str(caught.value)


def test_a_focus_inside_the_lens_is_refused(make):
    with pytest.raises(OpticsError, match="focus"):
        make().focused(0.06)
