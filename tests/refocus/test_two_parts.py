"""Light in two parts, against brute force: a plane mirror is a window to another scene."""

import numpy as np
import pytest
from test_depth_slicing import CAMERA, everywhere, grey, seen, sliced

from lfcore import SensorPlane, Slab, open_device
from lfcore.evaluation.metrics import psnr
from lfcore.optics.ray_cells import displaced_views
from lfcore.refocus.two_parts import TwoPartSlicer, placed_parts
from lfcore.rendering.direct import focused_camera

REFLECTED = [
    (7.0, grey(lambda x, y: 0 * x + 0.9), lambda x, y: np.abs(x - 0.1) < 0.1),
    (12.0, grey(lambda x, y: 0.5 + 0.45 * np.sin(9 * x) * np.sin(8 * y)), everywhere),
]
CHECKER = grey(lambda x, y: 0.15 + 0.35 * ((np.floor(4 * x) + np.floor(4 * y)) % 2))
BLACK = grey(lambda x, y: 0 * x)
WALL = (9.0, grey(lambda x, y: 0.3 + 0.2 * np.sin(5 * x)), everywhere)
ROD = (2.5, grey(lambda x, y: 0 * x + 0.05), lambda x, y: np.abs(x + 0.4) < 0.12)


def card(x, y):
    return (np.abs(x) < 0.9) & (np.abs(y) < 0.7)


COAT, MIRROR, FLOOR = (4.0, CHECKER, card), (4.0, BLACK, card), (4.0, CHECKER, everywhere)


def in_parts(views, surfaces, shiny, strength=0.5):
    """Both parts of rays; surface number ``shiny`` reflects what is behind it in another scene."""
    own = seen(views, surfaces)
    marked = [
        (z, grey(lambda x, y, is_shiny=k == shiny: 0 * x + is_shiny), where)
        for k, (z, _, where) in enumerate(surfaces)
    ]
    is_shiny = seen(views, marked)[0][..., 0] > 0.5
    light, depth = seen(views, REFLECTED)
    light[~is_shiny] = 0
    return [own, (light * np.float32(strength), np.where(is_shiny, depth, np.float32(0)))]


def picture(views, plane, pixels, parts, **more):
    slicer = TwoPartSlicer(views, [plane], pixels, **more)
    slicer.add(slice(0, len(parts[0][0])), [tuple(map(np.copy, part)) for part in parts])
    return slicer.pictures()[0]


def true_picture(surfaces, shiny, plane, pixels):
    """By many rays, each in its own pixel of a camera that is focused there."""
    views = displaced_views(Slab(focused_camera(CAMERA, plane), 10, 3 * pixels))
    light = sum(light for light, _ in in_parts(views, surfaces, shiny)).mean(0)
    return light.reshape(pixels, 3, pixels, 3, 3).mean((1, 3))


@pytest.mark.parametrize(
    ("surfaces", "shiny", "focus", "least_db", "more_db"),
    [
        ([COAT, WALL], 0, 4.0, 42, 0.1), ([COAT, WALL], 0, 12.0, 38, 3),
        ([ROD, FLOOR], 1, 12.0, 38, 3), ([MIRROR, WALL], 0, 12.0, 48, 10),
    ],
)  # fmt: skip
def test_a_reflection_is_in_focus_where_its_image_is(surfaces, shiny, focus, least_db, more_db):
    """Planes of the surface and of the image, better than all light at either depth."""
    plane, pixels = SensorPlane(focus, 1.0, "square"), 32
    views, truth = (
        displaced_views(Slab(CAMERA, 4, 2 * pixels)), true_picture(surfaces, shiny, plane, pixels)
    )  # fmt: skip
    own, specular = in_parts(views, surfaces, shiny)
    inner = slice(pixels // 5, -pixels // 5)

    def quality(made):
        return psnr(made[inner, inner], truth[inner, inner], peak=1)

    found = quality(picture(views, plane, pixels, [own, specular]))
    alone = quality(sliced(views, [plane], pixels, own[0] + specular[0], own[1])[0])
    assert found > least_db and found > more_db + alone


def test_light_of_both_parts_is_added_up_to_the_edge():
    """A coat with an even reflection far behind: at its edge, in focus, nothing of it is missing or
    beside it."""
    views, plane = displaced_views(Slab(CAMERA, 4, 64)), SensorPlane(4.0, 1.0, "square")
    half = (4.0, grey(lambda x, y: 0 * x + 0.3), lambda x, y: x < 0)
    own, (light, depth) = in_parts(views, [half, (4.0, BLACK, everywhere)], 0)
    light[light.any(axis=-1)] = 0.2
    rows = picture(views, plane, 32, [own, (light, depth)])[..., 0]
    np.testing.assert_allclose(rows[:, 2:15], 0.5, atol=1e-4)
    np.testing.assert_allclose(rows[:, 17:], 0, atol=1e-4)


@pytest.mark.parametrize("stops", [0, 3])
def test_the_same_bits_in_any_parts_and_on_any_number_of_threads(stops):
    views, plane = displaced_views(Slab(CAMERA, 4, 48)), SensorPlane(6.0, 1.4)
    parts = in_parts(views, [COAT, WALL], 0)
    whole = picture(views, plane, 24, parts, device=open_device(threads=1), stops=stops)
    slicer = TwoPartSlicer(views, [plane], 24, stops=stops)
    for first in (24, 0):
        for part in (slice(9, 16), slice(0, 9)):
            rows = [tuple(each[part, first : first + 24] for each in both) for both in parts]
            slicer.add(part, rows, first)
    np.testing.assert_array_equal(slicer.pictures()[0], whole)


def test_without_a_specular_part_pictures_are_those_of_one_part():
    views, plane = displaced_views(Slab(CAMERA, 2, 32)), SensorPlane(6.0, 1.4)
    own = seen(views, [COAT, WALL])
    nothing = np.zeros_like(own[0]), np.zeros_like(own[1])
    expected = sliced(views, [plane], 16, *own)[0]
    for parts in ([own], [own, nothing]):
        np.testing.assert_array_equal(picture(views, plane, 16, parts), expected)


def test_what_mirrors_show_takes_their_place():
    views = displaced_views(Slab(CAMERA, 2, 16))
    own, specular = in_parts(views, [MIRROR, WALL], 0)
    ((light, depth),) = placed_parts([tuple(map(np.copy, part)) for part in (own, specular)])
    is_mirror = specular[1] > 0
    np.testing.assert_array_equal(light[is_mirror], specular[0][is_mirror])
    np.testing.assert_array_equal(depth, np.where(is_mirror, specular[1], own[1]))
