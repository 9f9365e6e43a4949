"""The page of a film in a real browser: its instants, and how it plays."""

import pytest
from moving_scene import moving_squares
from selenium.webdriver import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait
from test_viewer_page import described
from viewer_browser import choose, opened_film, pixels, psnr, settle, state

import lfcore
from lfcore.colour import srgb_codes

pytestmark = pytest.mark.browser
TIMES = [0.0, 0.2, 0.4, 0.6]


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "film.mkv"
    return lfcore.record(moving_squares(), path, times=TIMES, pixels=48)


@pytest.fixture
def opened(browser, film):
    yield from opened_film(browser, film)


def test_each_instant_is_what_refocus_makes(opened, film):
    near = film.disparity_of(2.0)
    for k in (0, 3, 1, 0):
        choose(opened, k=k, d=near, a=2)
        plane = film.at(k).plane(disparity_px=state(opened)["d"], aperture_views=2)
        expected = srgb_codes(film.at(k).refocus_many([plane])[0])
        assert psnr(pixels(opened), expected) > 36, k
        assert f"--instant {k} " in opened.find_element("id", "command").text


def test_it_plays_and_a_click_pulls_the_focus(opened, film):
    choose(opened, d=film.disparity_of(4.0))
    opened.find_element(By.ID, "play").click()
    seen = set()

    def all_seen(browser):
        seen.add(state(browser)["k"])
        return len(seen) == len(TIMES)

    WebDriverWait(opened, 60, 0.02).until(all_seen)
    # A click on the wall behind, near the picture's corner.
    opened.execute_script("lightFieldViewer.set({d: arguments[0]})", film.disparity_of(2.0))
    canvas = opened.find_element("id", "canvas")
    aside = int(-0.45 * canvas.size["width"]), int(-0.45 * canvas.size["height"])
    ActionChains(opened).move_to_element_with_offset(canvas, *aside).click().perform()
    far = film.disparity_of(4.0)
    WebDriverWait(opened, 60, 0.02).until(lambda one: abs(state(one)["d"] - far) < 0.1)
    assert state(opened)["u"] < 0.1
    opened.find_element(By.ID, "play").click()
    settle(opened)
    shown = state(opened)["k"]
    expected = srgb_codes(film.at(shown).refocus(disparity_px=state(opened)["d"]))
    assert psnr(pixels(opened), expected) > 36


def test_it_plays_once_however_fast_it_is_stopped_and_played(opened):
    """Of what sets instants, only what was played last goes on."""
    shown = opened.execute_async_script("""
        const [done] = arguments, {film} = lightFieldViewer;
        const pause = (ms) => new Promise((next) => setTimeout(next, ms));
        const {restored} = Film.prototype;
        let asked = 0;
        film.restored = function (k) { asked += 1; return restored.call(this, k); };
        lightFieldViewer.set = () => {};  // draws nothing
        (async () => {
          for (const k of film.instants.keys()) await restored.call(film, k);
          film.fps = 5;
          for (let k = 0; k < 9; k++) film.play();  // while an instant is restored
          await pause(50);
          for (let k = 0; k < 8; k++) film.play();  // within a pause
          await pause(400);
          asked = 0;
          await pause(1000);
          film.play();
          delete lightFieldViewer.set;
          delete film.restored;
          done(asked);
        })();
    """)
    assert 1 <= shown <= 6
    settle(opened)


def test_few_instants_are_held_and_none_that_failed(opened):
    held = opened.execute_async_script("""
        const [done] = arguments, {film} = lightFieldViewer, {instants} = film, own = instants[2];
        (async () => {
          film.most = 2;
          for (const k of [0, 1, 2, 3, 0]) await film.restored(k);
          const few = film.held.size;
          film.held.clear();
          instants[2] = {...own, depth: null};
          const failed = await film.restored(2).then(() => false, () => true);
          instants[2] = own;
          const again = await film.restored(2).then((one) => one.own === own, () => false);
          done([few, failed, again]);
        })();
    """)
    assert held == [2, True, True]


def test_one_instant_has_a_page_without_a_film(film):
    alone, whole = (described(page.html) for page in (film.at(2).viewer(film=False), film.viewer()))
    assert alone["film"] is None and len(whole["film"]["instants"]) == 3
    assert whole["film"]["fps"] == pytest.approx(5)
