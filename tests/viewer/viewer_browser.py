"""A headless Chromium that tests drive, and the pixels of a page's canvas."""

import base64
import io
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lfcore.evaluation.metrics import psnr as psnr_of

FLAGS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--disable-dev-shm-usage",
    "--window-size=1100,900", "--force-device-scale-factor=1",
)  # fmt: skip
SETTLED = "return Boolean(globalThis.lightFieldViewer && lightFieldViewer.whole)"


def needed() -> tuple[str, str]:
    """Paths of the browser and of its driver; else the test is skipped, and says why."""
    browser = shutil.which("chromium") or shutil.which("google-chrome")
    driver = shutil.which("chromedriver")
    if not browser or not driver:
        pytest.skip("no browser: apt-get install chromium chromium-driver")
    pytest.importorskip("selenium", reason="selenium is not installed: pip install -e '.[dev]'")
    return browser, driver


@contextmanager
def chromium(profile: Path, *more: str) -> Iterator:
    """A browser with a new profile in the folder ``profile``."""
    browser, driver = needed()
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in (*FLAGS, f"--user-data-dir={profile}", *more):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    opened = webdriver.Chrome(options=options, service=Service(driver))
    try:
        opened.set_script_timeout(60)
        yield opened
    finally:
        opened.quit()


def visit(browser, page: Path, link: str = "") -> None:
    """Open a page afresh and wait for its whole picture."""
    browser.get("about:blank")
    browser.get(page.as_uri() + link)
    settle(browser)


@contextmanager
def before_pages(browser, script: str) -> Iterator:
    """Pages that are opened within the block run a script before their own."""
    added = browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": script})
    try:
        yield
    finally:
        browser.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", added)


def settle(browser) -> None:
    from selenium.webdriver.support.ui import WebDriverWait

    WebDriverWait(browser, 60, 0.05).until(lambda one: one.execute_script(SETTLED))


def state(browser) -> dict:
    return browser.execute_script("return lightFieldViewer.state")


def choose(browser, **given) -> None:
    """Set values of the state, and wait for the whole picture."""
    browser.execute_script("lightFieldViewer.set(arguments[0])", given)
    settle(browser)


def pixels(browser) -> np.ndarray:
    """(H, W, 3) uint8 of the canvas."""
    url = browser.execute_script("return lightFieldViewer.canvas.toDataURL('image/png')")
    data = base64.b64decode(url.partition(",")[2])
    return np.array(Image.open(io.BytesIO(data)).convert("RGB"))


psnr = partial(psnr_of, peak=255)


def complaints(browser) -> list[str]:
    """What the console was told since it was last asked: warnings and errors of the page."""
    return [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]


def opened_at(browser, page):
    """The browser at a page; at the end nothing may have been complained of."""
    complaints(browser)
    visit(browser, page)
    yield browser
    assert complaints(browser) == []


def opened_film(browser, film):
    """As :func:`opened_at`, of a film's page, which is written once."""
    page = film.path.with_suffix(".html")
    if not page.exists():
        film.viewer().save(page)
    yield from opened_at(browser, page)
