"""The page of a mirror and a coat: its pictures are refocus's, and what a click focuses on."""

import numpy as np
import pytest
from mirror_room import PIXELS, mirror_room
from selenium.webdriver import ActionChains
from viewer_browser import before_pages, choose, opened_film, pixels, psnr, settle, state, visit

import lfcore
from lfcore.colour import srgb_codes

pytestmark = pytest.mark.browser
TIMES = [0.0, 0.5]
COAT_PX = slice(70, 100)
"""The columns of a view where its coat is."""


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("specular") / "film.mkv"
    return lfcore.record(mirror_room(), path, times=TIMES, pixels=2 * PIXELS)


@pytest.fixture
def opened(browser, film):
    yield from opened_film(browser, film)


def test_each_picture_is_what_refocus_makes(opened, film):
    """In focus at the surfaces, at the images, and from points of the lens."""
    start = {"single": False, "x": 0, "y": 0, "a": 4}
    for k, focus, given in (
        (0, 4.0, {}), (0, 12.0, {"a": 3}), (1, 12.0, {}), (1, 9.0, {"a": 2}), (0, 4.0, {}),
    ):  # fmt: skip
        now = film.at(k)
        choose(opened, **(start | {"k": k, "d": now.disparity_of(focus)} | given))
        plane = now.plane(disparity_px=state(opened)["d"], aperture_views=given.get("a", 4))
        expected = srgb_codes(now.refocus_many([plane])[0])
        assert psnr(pixels(opened), expected) > 38, (k, focus, given)
    choose(opened, **(start | {"single": True, "x": 0.8, "y": -0.6}))
    point = np.array([[0.8, -0.6]]) * film.slab.lens_pitch_m
    assert psnr(pixels(opened), srgb_codes(film.views_at(point)[0])) > 36


def test_a_second_click_on_a_mirror_focuses_on_its_surface(opened, film):
    """The image of what is 4 m behind the camera is 12 m away; a coat's own colour is at 4 m."""
    choose(opened, k=0, single=False)
    canvas = opened.find_element("id", "canvas")
    for place, distances in ((-0.1, (12, 4, 12)), (0.1, (4, 12))):
        for distance in distances:
            aside = int(place * canvas.size["width"])
            ActionChains(opened).move_to_element_with_offset(canvas, aside, 0).click().perform()
            settle(opened)
            focus = opened.execute_script(
                "return distance(lightFieldViewer.field, lightFieldViewer.state.d)"
            )
            assert focus == pytest.approx(distance, rel=0.06), place
    assert "second click" in opened.find_element("id", "status").text


def test_a_graphics_card_without_sums_shows_both_parts(opened, film):
    with before_pages(opened, "WebGL2RenderingContext.prototype.getExtension = () => null"):
        visit(opened, film.path.with_suffix(".html"))
        choose(opened, x=-0.5, y=0.5)
        shown, expected = pixels(opened), film.view(1, 2, codes=True)
        assert psnr(shown[:, COAT_PX], expected[:, COAT_PX]) > 33
