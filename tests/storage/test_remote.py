"""Light fields by URL, from a server on this machine that counts what it hands out."""

import contextlib
import http.server
import logging
import operator
import re
import sys
import threading
import time

import numpy as np
import pytest
from plain_scenes import CHART, SCENES

from lfcore import Encoding, LightField, StorageError
from lfcore.cli import main
from lfcore.storage import ranges
from lfcore.storage.layout import FrameLayout

pytest.importorskip("urllib3", reason="urllib3 is not installed: pip install -e '.[remote]'")


CLUSTER = b"\x1f\x43\xb6\x75"
"""The id of Matroska's clusters, between which structure is scattered."""


class Server(http.server.ThreadingHTTPServer):
    """Hands out one file, in ranges or whole; ``sent`` counts bytes."""

    def __init__(self, path, ranges: bool = True):
        self.data, self.ranges, self.sent = path.read_bytes(), ranges, 0
        super().__init__(("127.0.0.1", 0), Handler)
        self.url = f"http://127.0.0.1:{self.server_address[1]}/{path.name}"
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def __exit__(self, *error):
        self.shutdown()
        super().__exit__(*error)


class Bad(Server):
    """Serves ``good`` requests, and then fails in a way, ``failures`` times."""

    def __init__(self, path, way, good=0, failures=99):
        self.way, self.good, self.failures, self.asked = way, good, failures, 0
        self.gone = threading.Event()
        super().__init__(path)

    def fails(self):
        self.asked += 1
        return self.good < self.asked <= self.good + self.failures

    def __exit__(self, *error):
        self.gone.set()
        super().__exit__(*error)


class Handler(http.server.BaseHTTPRequestHandler):
    def do_GET(self):
        server, data = self.server, self.server.data
        if "missing" in self.path:
            self.send_error(404)
            return
        if isinstance(server, Bad) and server.fails():
            self.fail(server)
            return
        asked = re.fullmatch(r"bytes=(\d+)-(\d+)", self.headers.get("Range", ""))
        if asked and server.ranges:
            low, high = int(asked[1]), min(int(asked[2]) + 1, len(data))
            self.send_response(206)
            self.send_header("Content-Range", f"bytes {low}-{high - 1}/{len(data)}")
        else:
            low, high = 0, len(data)
            self.send_response(200)
        if server.ranges:
            self.send_header("Accept-Ranges", "bytes")
        self.send_header("Content-Length", str(high - low))
        self.end_headers()
        if self.command == "GET":
            server.sent += high - low
            self.wfile.write(data[low:high])

    def fail(self, server):
        """Nothing; a part and then nothing; a part and then the end; or no end."""
        low, high = map(int, re.findall(r"\d+", self.headers["Range"]))
        if server.way != "silent":
            length = "" if server.way == "endless" else f"Content-Length: {high - low + 1}\r\n"
            place = f"Content-Range: bytes {low}-{high}/{len(server.data)}\r\n"
            self.wfile.write(f"HTTP/1.0 206 OK\r\n{place}{length}\r\n".encode())
            self.wfile.write(server.data[low : low + 100])
        if server.way in ("silent", "stalled"):
            server.gone.wait(20)
        with contextlib.suppress(OSError):
            self.wfile.write(server.data[low + 100 : high + 1] if server.way == "endless" else b"")
            while server.way == "endless" and not server.gone.is_set():
                server.sent += self.wfile.write(bytes(1 << 16))

    def log_message(self, format, *arguments):
        pass


@pytest.fixture(scope="module", params=["views", "macropixels"])
def large(request, make_store, tmp_path_factory):
    """A file of some megabytes in many segments: lossless, of two layouts."""
    layout = FrameLayout(request.param, 8, 160, pixel_format="gbrp")
    folder = tmp_path_factory.mktemp("large")
    return make_store(folder, layout, Encoding("ffv1", "gbrp"), tiles=8)


def test_a_view_or_macropixel_costs_its_tiles(large):
    local = LightField.open(large.path)
    size = large.path.stat().st_size
    with Server(large.path) as server:
        field = LightField.open(server.url)
        opening = server.sent
        # The head, the index and the first frame, however many clusters there are.
        assert large.path.read_bytes().count(CLUSTER) > 6
        assert opening <= 64 << 10
        views = field.layout.kind == "views"
        name, x, y = ("view", 3, 2) if views else ("macropixel", 40, 30)
        read = operator.methodcaller(name, x, y, codes=True)
        np.testing.assert_array_equal(read(field), read(local))
        meeting = field.segments.meeting(x, y, x + 1, y + 1)
        held = sum(field.segments[index].bytes for index in meeting)
        assert held < 0.3 * size
        assert server.sent <= 1.2 * held + (64 << 10)
        before = server.sent
        read(field)
        assert server.sent == before  # nothing is fetched twice


def test_the_whole_file_is_fetched_about_once(large):
    with Server(large.path) as server:
        n = large.layout.views
        found, expected = (
            LightField.open(place).views(0, 0, n, n, codes=True)
            for place in (server.url, large.path)
        )
        np.testing.assert_array_equal(found, expected)
        assert server.sent <= 1.05 * large.path.stat().st_size


def test_the_command_tells_what_is_behind_a_url(stored, capsys, tmp_path):
    with Server(stored.path) as server:
        assert main(["info", server.url]) == 0
        said = capsys.readouterr().out
        assert server.url in said and "12 x 12 pixels, 6 x 6 views" in said
        assert main(["view", server.url, "-o", str(tmp_path / "view.png")]) == 0
        assert main(["info", f"{server.url}.missing"]) == 1
        assert capsys.readouterr().err.splitlines()[-1].endswith("missing: no such file.")


def test_stacks_and_depth_of_a_url_are_those_of_the_file(stored, tmp_path):
    """As of the file on disk, to the last bit; a stack names its picture after the URL's file."""
    made = {}
    with Server(stored.path) as server, contextlib.chdir(tmp_path):
        for name in (str(stored.path), f"{server.url}?version=1"):
            focus = ["--focus", "2", "4", "--sheet"]
            assert main(["stack", name, *focus]) == 0
            assert main(["stack", name, *focus, "--method", "blocks", "-o", "fast.png"]) == 0
            depth = ["--all-in-focus", "sharp.png", "-o", "depth.npz"]
            assert main(["depth", str(CHART), "--lightfield", name, *depth]) == 0
            files = [f"{stored.path.stem}_stack.png", "fast.png", "depth.npz", "sharp.png"]
            made[name] = [(tmp_path / file).read_bytes() for file in files]
    first, second = made.values()
    assert first == second


def test_a_server_without_ranges_is_one_clear_line(stored, capsys):
    with Server(stored.path, ranges=False) as server:
        assert main(["info", server.url]) == 1
        line = capsys.readouterr().err.strip()
        assert "\n" not in line
        assert line.startswith(f"{server.url}: ")
        assert "Download the file" in line


def test_a_host_that_does_not_answer_is_one_line(capsys):
    with pytest.raises(StorageError, match=r"http://127\.0\.0\.1:9/lf\.mkv: (no such file|cannot)"):
        LightField.open("http://127.0.0.1:9/lf.mkv")
    assert main(["info", "nothing://host/lf.mkv"]) == 1
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.mark.slow
@pytest.mark.parametrize("good", [0, 2], ids=["opening", "reading"])
@pytest.mark.parametrize("way", ["silent", "stalled", "short"])
def test_a_server_that_fails_is_asked_twice(stored, way, good, monkeypatch):
    monkeypatch.setattr(ranges, "TIMEOUT_S", 0.3)
    begun = time.monotonic()
    with Bad(stored.path, way, good) as server:
        with pytest.raises(StorageError, match=r"cannot be read: .*Download the file") as caught:
            LightField.open(server.url).view(0, 0)
        assert server.asked == good + 2
        if way != "short":
            assert "0.3 s" in str(caught.value)
    with Bad(stored.path, way, good, failures=1) as server:
        field = LightField.open(server.url)
        np.testing.assert_array_equal(field.view(0, 0), LightField.open(stored.path).view(0, 0))
    assert time.monotonic() - begun < 15


def test_no_more_is_read_than_was_asked_for(stored):
    with Bad(stored.path, "endless") as server:
        LightField.open(server.url).view(0, 0)
        assert server.sent < 64 << 20  # what the system's buffers take, for each request


@pytest.mark.parametrize(
    "url", ["zip://a.mkv", "reference://a", "github://o:r@/a.mkv", "file:///etc/passwd",
            "simplecache::http://127.0.0.1:9/a.mkv", "https://h/a.zip::zip://a.mkv", "memory://a"],
)  # fmt: skip
def test_other_schemes_are_refused_and_tried_by_nobody(url, monkeypatch):
    monkeypatch.setitem(sys.modules, "fsspec", None)
    with pytest.raises(StorageError, match=r"Give a URL of http"):
        LightField.open(url)


def test_a_file_in_an_object_store(stored, monkeypatch):
    moto = pytest.importorskip("moto.server")
    s3fs = pytest.importorskip("s3fs")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)  # no line for each request
    server = moto.ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    for name in ("AWS_ACCESS_KEY_ID", "AWS_SECRET_ACCESS_KEY"):
        monkeypatch.setenv(name, "any")
    monkeypatch.setenv("AWS_ENDPOINT_URL", "http://{}:{}".format(*server.get_host_and_port()))
    s3fs.S3FileSystem.clear_instance_cache()  # of another test's server
    try:
        made = s3fs.S3FileSystem()
        made.mkdir("bucket")
        made.put(str(stored.path), "bucket/a.mkv")
        found = LightField.open("s3://bucket/a.mkv").view(1, 2)
        np.testing.assert_array_equal(found, LightField.open(stored.path).view(1, 2))
        with pytest.raises(StorageError, match="no such file"):
            LightField.open("s3://bucket/b.mkv")
    finally:
        server.stop()


def test_depths_are_read_by_url_too(tmp_path):
    from lfcore.api import load_scene, record

    # So fine that FFmpeg learns from the first packets the pixel format of the depths alone.
    scene = load_scene(SCENES / "bike")
    spec = Encoding(depth=True, preset="ultrafast")
    local = record(scene, tmp_path / "a.mkv", pixels=128, encoding=spec)
    with Server(local.path) as server:
        field = LightField.open(server.url)
        np.testing.assert_array_equal(field.refocus(), local.refocus())
