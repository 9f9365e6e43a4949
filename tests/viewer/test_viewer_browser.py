"""The page in a real browser: its pixels against refocusing, what hands do, what it cannot do."""

import numpy as np
import pytest
from plain_scenes import CHART
from two_planes import FAR, NEAR, PIXELS
from viewer_browser import (
    before_pages,
    choose,
    complaints,
    opened_at,
    pixels,
    psnr,
    settle,
    state,
    visit,
)

from lfcore import Encoding, load_scene, record
from lfcore.colour import srgb_codes

pytestmark = pytest.mark.browser

NO_WEBGL2 = "HTMLCanvasElement.prototype.getContext = (own => function (kind, ...more) { " \
    "return kind === 'webgl2' ? null : own.call(this, kind, ...more); })" \
    "(HTMLCanvasElement.prototype.getContext);"  # fmt: skip


@pytest.fixture
def opened(browser, page):
    yield from opened_at(browser, page)


@pytest.mark.parametrize("filter", ["bilinear", "nearest"])
def test_the_canvas_shows_what_refocus_makes(opened, field, filter):
    """Lossless views: what differs is rounding, and 8 bits of the graphics card's interpolation."""
    # No shift lies half way between two pixels, where the last bit decides which is nearest.
    for d, a, shape in ((0, 9, "circle"), (0.7, 5.2, "square"), (FAR + 0.01, 7, "diamond"),
                        (NEAR + 0.01, 8, "polygon"), (-0.4, 0.5, "circle")):  # fmt: skip
        choose(opened, d=d, a=a, shape=shape, blades=5, turn=20, filter=filter)
        plane = field.plane(
            disparity_px=d, aperture_views=a, aperture=shape, blades=5, rotation_deg=20
        )
        picture = field.refocus_many([plane], filter=filter)[0]
        shown = pixels(opened)
        assert shown.shape == (PIXELS, PIXELS, 3) and shown.std() > 1
        assert psnr(shown, srgb_codes(picture)) > 45, (d, a, shape)


@pytest.mark.parametrize("form", ["jpeg", "webp"])
def test_a_lossy_page_is_near_refocusing(browser, field, tmp_path, form):
    field.viewer(format=form).save(tmp_path / "lossy.html")
    visit(browser, tmp_path / "lossy.html")
    choose(browser, d=NEAR, a=7)
    picture = field.refocus(disparity_px=NEAR, aperture_views=7, filter="bilinear")
    assert psnr(pixels(browser), srgb_codes(picture)) > 35
    assert complaints(browser) == []


def test_coloured_edges_keep_their_colour(browser, tmp_path):
    """The chart is saturated red, green and blue: with chroma of half size, at most 30 dB."""
    chart, file, encoding = load_scene(CHART), tmp_path / "chart.mkv", Encoding(depth=False)
    field = record(chart, file, views=9, pixels=64, encoding=encoding)
    field.viewer(format="jpeg", jpeg_quality=90).save(tmp_path / "chart.html")
    visit(browser, tmp_path / "chart.html")
    for distance, a in ((1.0, 9), (1.33, 5), (2.0, 2)):
        d = field.disparity_of(distance)
        choose(browser, d=d, a=a)
        picture = field.refocus(disparity_px=d, aperture_views=a, filter="bilinear")
        assert psnr(pixels(browser), srgb_codes(picture)) > 40, (distance, a)
    choose(browser, single=True, x=1, y=-2, d=0)
    assert psnr(pixels(browser), field.view(5, 2, codes=True)) > 35
    assert complaints(browser) == []


def hands(browser, **more):
    from selenium.webdriver import ActionChains

    return ActionChains(browser, **more)


def drag(browser, dx, dy):
    canvas = browser.find_element("id", "canvas")
    actions = hands(browser, duration=20).move_to_element(canvas).click_and_hold()
    for _ in range(4):
        actions = actions.move_by_offset(dx // 4, dy // 4)
    actions.release().perform()
    settle(browser)


def test_dragging_moves_the_viewpoint(opened):
    before = pixels(opened)
    drag(opened, -80, 40)
    moved = state(opened)
    assert moved["x"] > 0.5 and moved["y"] < -0.2 and moved["d"] == 0
    assert np.abs(pixels(opened).astype(int) - before).mean() > 1
    for _ in range(3):
        drag(opened, -240, 0)
    assert state(opened)["x"] == 4  # the last view


def test_a_click_focuses_on_what_is_there(opened):
    canvas = opened.find_element("id", "canvas")
    hands(opened).move_to_element(canvas).click().perform()
    settle(opened)
    assert abs(state(opened)["d"] - NEAR) < 0.15
    corner = int(0.45 * canvas.size["width"])
    hands(opened).move_to_element_with_offset(canvas, -corner, -corner).click().perform()
    settle(opened)
    assert abs(state(opened)["d"] - FAR) < 0.15
    assert state(opened)["x"] == 0


def test_a_tilted_plane_is_sharp_near_on_one_side_and_far_on_the_other(opened, field):
    """Against shift-sum of each column by its own disparity."""
    choose(opened, d=0.2, tx=1.5, a=9)
    shown = pixels(opened)
    for column in (8, 31, 56):
        d = 0.2 + 1.5 * (column - (PIXELS - 1) / 2) / PIXELS
        own = field.refocus(disparity_px=d, aperture_views=9, filter="bilinear")
        assert psnr(shown[:, column], srgb_codes(own)[:, column]) > 45


def test_a_single_view_is_that_view(opened, field):
    choose(opened, single=True, x=2, y=-3, d=0)
    np.testing.assert_allclose(pixels(opened), field.view(6, 1, codes=True), atol=1)


def test_epipolar_slices_are_rows_of_all_views(opened, field):
    choose(opened, epi=True, v=0.5, d=0)
    shown = pixels(opened)
    high = shown.shape[0] - PIXELS
    assert shown.shape == (PIXELS + high, PIXELS + high, 3)
    for i in range(9):
        row = shown[PIXELS + int((i + 0.5) * high / 9), :PIXELS]
        both = field.view(i, 4, codes=True)[31:33].astype(float).mean(0)
        assert psnr(row, both) > 25


def test_depth_is_shown_and_near_is_bright(opened):
    choose(opened, depth=True)
    shown = pixels(opened)
    assert shown[28:36, 28:36].mean() > shown[:6].mean() + 80


def test_keys_and_touch(opened):
    from selenium.webdriver.common.keys import Keys

    canvas = opened.find_element("id", "canvas")
    canvas.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT, Keys.ARROW_DOWN, "+", "[", "e", "s")
    settle(opened)
    found = state(opened)
    assert (found["x"], found["y"]) == (1, 0.5) and found["d"] > 0 and found["a"] < 9
    assert found["epi"] and found["single"]
    canvas.send_keys("r")
    settle(opened)
    fingers(opened, canvas, [(40, 20), (80, 20)])
    assert state(opened)["a"] == 9  # cannot open farther
    fingers(opened, canvas, [(80, 20), (40, 20)])
    assert state(opened)["a"] < 6


def fingers(browser, canvas, apart):
    """Two fingers that go from the first distance from the middle to the second, by touch."""
    box = canvas.rect
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def touch(kind, points):
        points = [{"x": px, "y": y, "id": k} for k, px in enumerate(points)]
        browser.execute_cdp_cmd("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    (first, _), (last, _) = apart
    touch("touchStart", [x - first, x + first])
    for share in (0.5, 1.0):
        now = first + share * (last - first)
        touch("touchMove", [x - now, x + now])
    touch("touchEnd", [])
    settle(browser)


def test_a_link_opens_the_same_picture(opened, page):
    choose(opened, d=0.5, a=4.5, shape="diamond", x=1.5, tx=0.25)
    shown, link = pixels(opened), opened.current_url.partition("#")[2]
    visit(opened, page, f"#{link}")
    np.testing.assert_array_equal(pixels(opened), shown)
    assert state(opened)["shape"] == "diamond"


def test_controls_say_what_the_state_is(opened, field):
    choose(opened, d=0.5, a=4.5)
    words = {key: opened.find_element("id", key).text for key in ("d-text", "f-text", "command")}
    assert words["d-text"] == f"{field.distance_of(0.5):.3g} m, 0.50 px"
    assert words["f-text"] == "f/4.00"
    for key in ("d", "f"):  # what a screen reader says of the slider
        slider = opened.find_element("id", key)
        assert slider.get_attribute("aria-valuetext") == words[f"{key}-text"]
    assert "--focus 0.5px --f-number 4.5views --aperture circle" in words["command"]


def test_every_control_is_reached_by_tab_and_named_for_screen_readers(opened):
    """WCAG 2.2: 2.1.1, 2.4.3, 4.1.2, and 2.5.7: all that a drag does, a slider does."""
    from selenium.webdriver.common.keys import Keys

    tree = opened.execute_cdp_cmd("Accessibility.getFullAXTree", {})["nodes"]
    found = [
        (node["role"]["value"], node.get("name", {}).get("value", ""))
        for node in tree
        if any(one["name"] == "focusable" for one in node.get("properties", ()))
        and node["role"]["value"] not in ("RootWebArea", "MenuListOption", "option")
    ]
    assert found[0] == ("application", "The light field") and all(name for _, name in found)
    sliders = [name for role, name in found if role == "slider"]
    ways = ["Viewpoint, left to right", "Viewpoint, top to bottom"]
    assert sliders[:5] == ["Focus", "Aperture", "F-number", *ways]
    reached = []
    for _ in found:
        hands(opened).send_keys(Keys.TAB).perform()
        reached.append(opened.execute_script("return document.activeElement.id || 'more'"))
        if reached[-1] == "x":
            hands(opened).send_keys(Keys.ARROW_RIGHT).perform()
    assert reached[0] == "canvas" and len(set(reached)) == len(found)
    assert state(opened)["x"] > 0


def test_controls_are_large_enough_for_a_finger(opened):
    """WCAG 2.2, 2.5.8: 24 pixels; of a box to tick, its label takes the touch, too."""
    sizes = opened.execute_script("""
        const all = [...document.querySelectorAll("input, select, button")];
        return all.filter((one) => one.offsetParent).map((one) => {
          const box = (one.closest(".toggle") || one).getBoundingClientRect();
          return Math.min(box.width, box.height);
        });
    """)
    assert len(sizes) > 10 and min(sizes) >= 24


def test_the_page_says_that_it_loads_until_there_is_a_picture(browser, page):
    never = "HTMLImageElement.prototype.decode = () => new Promise(() => {})"
    with before_pages(browser, never):
        browser.get("about:blank")
        browser.get(page.as_uri())
        loading = browser.find_element("id", "loading")
        assert loading.is_displayed() and loading.text.startswith("Loading")
    visit(browser, page)
    assert not browser.find_element("id", "loading").is_displayed()


def test_a_browser_without_webgl2_shows_single_views(browser, page, field):
    with before_pages(browser, NO_WEBGL2):
        visit(browser, page)
        said = browser.find_element("id", "status").text
        assert "no WebGL2: only single views are shown" in said and "lfcore refocus" in said
        choose(browser, x=-4, y=4)
        np.testing.assert_array_equal(pixels(browser), field.view(0, 8, codes=True))
        assert complaints(browser) == []


def test_a_browser_without_the_pictures_format_says_what_to_do(browser, page):
    from selenium.webdriver.support.ui import WebDriverWait

    refusal = "HTMLImageElement.prototype.decode = () => Promise.reject(new Error('unknown'))"
    with before_pages(browser, refusal):
        browser.get("about:blank")
        browser.get(page.as_uri())
        status = browser.find_element("id", "status")
        WebDriverWait(browser, 20).until(lambda _: "cannot be shown" in status.text)
        wanted = "this browser reads no WEBP pictures. Make the page with --format jpeg"
        assert wanted in status.text
        assert not browser.find_element("id", "loading").is_displayed()


def test_pictures_come_often_enough_while_something_moves(opened):
    """Ten a second in software, on a machine that does something else: at least three here."""
    per_second = opened.execute_async_script("""
        const done = arguments[0], begun = performance.now();
        let count = 0;
        const next = () => {
          if (++count === 12) { done(1000 * count / (performance.now() - begun)); return; }
          lightFieldViewer.set({x: Math.sin(count)});
          requestAnimationFrame(() => requestAnimationFrame(next));
        };
        next();
    """)
    assert per_second > 3
