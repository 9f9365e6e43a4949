"""The page in Firefox: the pictures of refocusing, keys and touch.

Firefox is driven by its own Marionette protocol: Debian has no driver for Selenium.
https://firefox-source-docs.mozilla.org/testing/marionette/Protocol.html
"""

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from plain_scenes import SCENES
from two_planes import NEAR
from viewer_browser import choose, pixels, psnr, settle, state, visit

from lfcore import load_scene, record
from lfcore.colour import srgb_codes

pytestmark = pytest.mark.browser

TAB, RIGHT = "\ue004", "\ue014"
PATIENCE_S = 60
PREFERENCES = {
    "marionette.port": 0,  # a free one, which the profile then names
    "webgl.force-enabled": True,
    "browser.backup.enabled": False,
    "app.update.enabled": False,
}


class Firefox:
    """The calls of a Selenium browser that :mod:`viewer_browser` needs, and actions of hands."""

    def __init__(self, port: int):
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self._stream, self._count = self._socket.makefile("rb"), 0
        self._read()  # the greeting
        self.command("WebDriver:NewSession")
        self.command("WebDriver:SetWindowRect", width=1100, height=900)

    def _read(self) -> Any:
        length = b"".join(iter(lambda: self._stream.read(1), b":"))
        return json.loads(self._stream.read(int(length)))

    def command(self, name: str, **parameters: Any) -> Any:
        self._count += 1
        message = json.dumps([0, self._count, name, parameters]).encode()
        self._socket.sendall(b"%d:%s" % (len(message), message))
        _, _, error, result = self._read()
        assert error is None, error
        return result.get("value") if isinstance(result, dict) else result

    def get(self, url: str) -> None:
        self.command("WebDriver:Navigate", url=url)

    def execute_script(self, script: str, *arguments: Any) -> Any:
        return self.command("WebDriver:ExecuteScript", script=script, args=list(arguments))

    def press(self, *keys: str) -> None:
        """Press keys, one after the other."""
        steps = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self._perform({"type": "key", "id": "keys", "actions": steps})

    def tap(self, x: float, y: float) -> None:
        """Touch a place of the window, in its pixels."""
        steps = [{"type": "pointerMove", "x": round(x), "y": round(y)}]
        steps += [{"type": kind, "button": 0} for kind in ("pointerDown", "pointerUp")]
        finger = {"type": "pointer", "id": "finger", "parameters": {"pointerType": "touch"}}
        self._perform(finger | {"actions": steps})

    def _perform(self, source: dict) -> None:
        self.command("WebDriver:PerformActions", actions=[source])


@contextmanager
def _screen() -> Iterator[str]:
    """A virtual screen: without one Firefox has no WebGL (its bug 1375585)."""
    with subprocess.Popen(
        ["Xvfb", "-displayfd", "1", "-screen", "0", "1200x1000x24", "-nolisten", "tcp"],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    ) as server:  # fmt: skip
        try:
            yield f":{server.stdout.readline().strip()}"
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def browser(tmp_path_factory) -> Iterator[Firefox]:
    """A browser with a new profile."""
    program = shutil.which("firefox-esr") or shutil.which("firefox")
    if not program or not shutil.which("Xvfb"):
        pytest.skip("no Firefox on a virtual screen: apt-get install firefox-esr xvfb")
    lines = [
        f"user_pref({json.dumps(key)}, {json.dumps(one)});" for key, one in PREFERENCES.items()
    ]
    profile = tmp_path_factory.mktemp("firefox")
    (profile / "user.js").write_text("\n".join(lines))
    own = {"HOME": str(profile), "LIBGL_ALWAYS_SOFTWARE": "1"}
    with _screen() as display, subprocess.Popen(
        [program, "--marionette", "--no-remote", "--profile", profile],
        env=os.environ | own | {"DISPLAY": display},
        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
    ) as running:  # fmt: skip
        try:
            yield Firefox(_port(profile / "MarionetteActivePort"))
        finally:
            running.terminate()


def _port(file: Path) -> int:
    end = time.monotonic() + PATIENCE_S
    while not file.exists() or not file.read_text():
        assert time.monotonic() < end, "Firefox did not start"
        time.sleep(0.1)
    return int(file.read_text())


def test_firefox_shows_what_refocus_makes(browser, tmp_path):
    field = record(load_scene(SCENES / "bike"), tmp_path / "bike.mkv", pixels=64)
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
