"""The page in Firefox: the pictures of refocusing, keys and touch."""

from pathlib import Path

import pytest
from firefox import firefox
from two_planes import NEAR
from viewer_browser import choose, pixels, psnr, settle, state, visit

from lfcore import load_scene, record
from lfcore.colour import srgb_codes

BIKE = Path(__file__).parents[2] / "scenes" / "bike"
TAB, RIGHT = "\ue004", "\ue014"

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    with firefox(tmp_path_factory.mktemp("firefox") / "profile") as opened:
        yield opened


def test_firefox_shows_what_refocus_makes(browser, tmp_path):
    field = record(load_scene(BIKE), tmp_path / "bike.mkv", pixels=96)
    field.viewer().save(tmp_path / "bike.html")
    visit(browser, tmp_path / "bike.html")
    near, far = (field.disparity_of(end) for end in field.depth_range)
    for d, a in ((near, 4), (far, 4), ((near + far) / 2, 2.3)):
        choose(browser, d=d, a=a)
        picture = field.refocus(disparity_px=d, aperture_views=a)
        assert psnr(pixels(browser), srgb_codes(picture)) > 38, (d, a)


def test_keys_and_touch_in_firefox(browser, page):
    visit(browser, page)
    browser.press(TAB, RIGHT, RIGHT, "+")
    settle(browser)
    found = state(browser)
    assert found["x"] == 1 and found["d"] > 0
    browser.press("r")
    box = browser.execute_script(
        "const box = lightFieldViewer.canvas.getBoundingClientRect();"
        "return [box.left + box.width / 2, box.top + box.height / 2]"
    )
    browser.tap(*box)
    settle(browser)
    assert abs(state(browser)["d"] - NEAR) < 0.15 and state(browser)["x"] == 0
