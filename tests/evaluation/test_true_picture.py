"""True pictures, and how well they are known."""

import pytest

from lfcore import Lattice, OpticsError, Slab
from lfcore.evaluation.true_picture import inner_psnr, true_pictures
from lfcore.optics.ray_cells import crossed_views
from lfcore.rendering.direct import focused_camera

pytestmark = pytest.mark.kernels


def test_two_lattices_agree_on_the_truth(reference):
    side = reference.size.width
    assert reference.pictures.shape == (2, side, side, 3)
    assert (reference.known_db > 45).all()


def test_the_truth_does_not_depend_on_how_it_is_traced(chart, reference):
    """Rays that each count in their own pixel, none spread, give the same picture."""
    plane, side = reference.planes[0], reference.size.width
    slab = Slab(focused_camera(chart.scene.camera, plane), 24, 3 * side)
    inside = plane.mask(slab).ravel()
    light = chart.bundle_radiance(crossed_views(slab).bundles())[inside].clip(0, 1).mean(0)
    plain = light.reshape(side, 3, side, 3, 3).mean((1, 3))
    assert inner_psnr(plain, reference.pictures[0]) > 40


def test_alike_lattices_are_no_reference(chart, reference):
    with pytest.raises(OpticsError, match="too alike"):
        true_pictures(chart, reference.planes, 24, (Lattice(8, 3), Lattice(8, 4)))
