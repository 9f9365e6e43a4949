"""The viewer's page without a browser: its views, map and arithmetic, that it asks no host, and
that it undoes what was coded as differences.
"""

import _thread
import base64
import io
import json
import re
import shutil
import signal
import subprocess
import threading
import urllib.request
import webbrowser
import zlib
from functools import partial
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from PIL import Image
from plain_scenes import CHART
from two_planes import FAR, NEAR, PIXELS, SLAB, VIEWS

import lfcore.viewer.page as viewer_page
from lfcore import Aperture, Lattice, LightField, Scene, StorageError, load_scene, record
from lfcore.cli import main
from lfcore.rendering.depth import disparity
from lfcore.viewer.atlas import Choice, choose, encode, read
from lfcore.viewer.disparity import estimate
from lfcore.viewer.neighbours import TOLERANCE, Neighbours

FOLDER = Path(viewer_page.__file__).parent


def described(html: str) -> dict:
    """What a page says of its light field."""
    return json.loads(re.search(r'id="field">(.*?)</script>', html, re.DOTALL)[1])


def program(html: str) -> str:
    packed = re.search(r'id="program">(.*?)</script>', html)[1]
    return zlib.decompress(base64.b64decode(packed)).decode()


def mapped(field) -> tuple[dict, np.ndarray]:
    """What a field's page says of its map, and the map's codes."""
    data = described(field.viewer().html)["map"]
    picture = Image.open(io.BytesIO(base64.b64decode(data["page"].partition(",")[2])))
    return data, np.array(picture)[..., 0]


def test_views_are_those_of_the_file_or_smaller(field):
    chosen = choose(field)
    pictures = read(field, chosen)
    assert len(pictures) == VIEWS**2
    for k in (0, 11, 40, 80):
        i, j = chosen.samples[k]
        np.testing.assert_allclose(pictures[k], field.view(i, j, codes=True), atol=1)
    smaller = choose(field, 9, 32)
    assert (smaller.width, smaller.height, smaller.scale) == (32, 32, 0.5)
    assert read(field, smaller).shape == (81, 32, 32, 3)


def test_an_atlas_holds_every_view_in_its_cell(monkeypatch):
    monkeypatch.setattr("lfcore.viewer.atlas.PAGE_SIDE", 40)
    pictures = np.random.default_rng(1).integers(0, 256, (23, 7, 9, 3), dtype=np.uint8)
    atlas = encode(pictures, "webp", 100)
    assert len(atlas.pages) == 2  # 4 x 5 cells in 40 pixels a side
    for k in (0, 6, 19, 20, 22):
        number, cell = divmod(k, atlas.across * atlas.down)
        row, column = divmod(cell, atlas.across)
        page = np.array(Image.open(io.BytesIO(atlas.pages[number])).convert("RGB"))
        assert max(page.shape) <= 40
        held = page[7 * row : 7 * (row + 1), 9 * column : 9 * (column + 1)]
        np.testing.assert_array_equal(held, pictures[k])


def test_a_page_that_cannot_be_is_refused(field):
    for given, said in (
        ({"grid": 8}, "from 9 to 33"), ({"grid": 34}, "from 9 to 33"), ({"pixels": 65}, "to 64")
    ):  # fmt: skip
        with pytest.raises(StorageError, match=said):
            choose(field, **given)
    for coding in ({"format": "gif"}, {"jpeg_quality": 0}):
        with pytest.raises(StorageError, match=next(iter(coding))):
            encode(np.zeros((1, 4, 4, 3), np.uint8), **coding)


def test_views_in_the_middle_of_equal_cells():
    field = SimpleNamespace(
        grid=(32, 3), picture_size=(8, 4), path="x", metadata=SimpleNamespace(depth=None)
    )
    chosen = choose(field, 9)
    assert isinstance(chosen, Choice) and chosen.rows.tolist() == [0, 1, 2]
    assert len(chosen.columns) == 9 and chosen.columns[0] == 1 and chosen.columns[-1] == 30


def test_the_map_knows_near_from_far(field):
    pictures = read(field, choose(field))
    places = choose(field).samples - (VIEWS - 1) / 2
    found = estimate(pictures, places, -1.5, 2.0)
    assert found.shape == (PIXELS, PIXELS)
    assert np.abs(np.median(found[24:40, 24:40]) - NEAR) < 0.1
    assert np.abs(np.median(found[:8]) - FAR) < 0.1
    assert estimate(pictures[:1], places[:1], -1, 1) is None


@pytest.fixture(scope="module")
def with_depth(tmp_path_factory):
    """The chart, and a light field of it that holds depth."""
    scene, file = load_scene(CHART), tmp_path_factory.mktemp("depth") / "d.mkv"
    return scene, record(scene, file, views=Lattice(3, displaced=False), pixels=24)


def test_the_map_is_the_depth_that_the_file_holds(with_depth):
    """As traced, to the steps of the stored codes and of the map's."""
    scene, field = with_depth
    html = field.viewer().html
    assert "The file has depth" in html and "estimate" not in re.sub("<script.*", "", html)
    data, codes = mapped(field)
    # Views of a file with depth have two pixels for one of a picture.
    assert codes.shape == (48, 48) == (data["height"], data["width"])
    shown = data["low"] + (data["high"] - data["low"]) * codes / 255.0
    exact = disparity(field.slab, field.depth(scene, np.array([[1, 1]]))[0])
    # A step of the map, and what depth is stored to: a sweep of a quarter pixel of a view.
    assert np.abs(shown - exact).max() < 0.25 + (data["high"] - data["low"]) / 255
    assert np.ptp(exact) > 0.5


def test_a_smaller_map_takes_pixels_and_no_means(with_depth, monkeypatch):
    monkeypatch.setattr(viewer_page, "MAP_SIDE", 16)
    data, codes = mapped(with_depth[1])
    assert codes.shape == (16, 16) == (data["height"], data["width"])
    # The chart's two depths, as the codec left them, and nothing between.
    assert np.all((codes < 8) | (codes > 247)) and np.ptp(codes) > 240


def test_a_page_asks_no_other_host(page):
    html = page.read_text()
    outside = re.sub(r'"data:image/(?:webp|jpeg);base64,[^"]*"', "", html) + program(html)
    assert not re.search(r"https?:|//[a-z]+\.[a-z]|\bfetch\(|XMLHttpRequest|import\(", outside)
    assert "default-src 'none'" in html
    assert "<title>&lt;two&gt; &amp; planes</title>" in html
    data = described(html)
    assert data["name"] == "<two> & planes" and data["views"] == VIEWS
    assert data["columns"] == (np.arange(VIEWS) - 4.0).tolist()
    assert data["range"][0] < FAR and data["range"][1] > NEAR


@pytest.mark.slow
def test_the_page_of_a_plain_model_is_at_most_four_times_the_file(tmp_path):
    ring = trimesh.creation.torus(1.6, 0.3).apply_translation((0.5, 0, -1))
    mesh = trimesh.util.concatenate([trimesh.creation.icosphere(4), ring])
    field = record(Scene.from_trimesh(mesh), tmp_path / "plain.mkv", pixels=256)
    assert len(field.viewer().html) < 4 * field.path.stat().st_size


def test_a_notebook_shows_a_frame(field):
    shown = field.viewer(pixels=16)._repr_html_()
    assert shown.startswith("<iframe srcdoc=") and shown.count("<") == 2


def test_the_command_writes_a_page_or_a_picture(field, tmp_path, capsys):
    page, picture = tmp_path / "lf.html", tmp_path / "lf.png"
    words = ["view", str(field.path)]
    assert main([*words, "-o", str(page), "--pixels", "32", "--format", "webp"]) == 0
    assert described(page.read_text())["atlas"]["pages"][0].startswith("data:image/webp;base64,")
    assert main([*words, "-o", str(picture), "--view", "0", "8"]) == 0
    np.testing.assert_array_equal(np.array(Image.open(picture)), field.view(0, 8, codes=True))
    capsys.readouterr()
    for more, said in (
        (["-o", str(picture), "--pixels", "9"], "--pixels: is for a page"),
        (["-o", str(picture), "--serve"], "--serve: is for a page"),
        (["-o", str(page), "--view", "2mm", "1mm"], "--view: is for a picture"),
        (["-o", str(page), "--grid", "3"], "grid: must be from 9 to 33"),
        (["--view", "2", "1"], "--output: is missing"),
        (["-o", str(picture), "--view", "2", "1mm"], "--view: mixes a column or row with mm"),
        (["--json"], "--json: reports on a file"),
    ):
        assert main([*words, *more]) == 1
        assert said in capsys.readouterr().err.splitlines()[-1]


@pytest.fixture
def interruptible():
    """Ctrl+C ends this process, also where the tests were started in a shell's background."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def test_the_command_alone_hands_the_page_to_the_browser(field, monkeypatch, capsys, interruptible):
    got = []

    def visit(address: str) -> None:
        def read() -> None:
            try:
                with urllib.request.urlopen(address, timeout=30) as page:
                    got.append(page.read().decode())
            finally:
                _thread.interrupt_main()  # as Ctrl+C, which ends the service

        threading.Thread(target=read).start()

    monkeypatch.setattr(webbrowser, "open", visit)
    assert main(["view", str(field.path), "--pixels", "32"]) == 130
    assert described(got[0])["views"] == VIEWS
    assert "http://127.0.0.1:" in capsys.readouterr().err


def node(script: str, program: str) -> object:
    """What a program over one of the page's scripts prints, as JSON."""
    path = shutil.which("node")
    if path is None:
        pytest.skip("no node: the page's arithmetic is not run outside the browser")
    text = (FOLDER / script).read_text() + program
    done = subprocess.run([path, "-"], input=text, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_the_page_opens_the_views_that_refocusing_opens(page, field):
    """The same mask as lfcore.optics.planes for every shape and many sizes."""
    data = described(page.read_text()) | {"atlas": {}, "map": None}
    cases = [
        {"shape": shape, "a": size, "blades": blades, "turn": turn}
        for shape in ("circle", "square", "diamond", "polygon")
        for size in (0.5, 1.3, 2.2, 4.7, 6.6, 9)
        for blades, turn in ((3, 0), (5, 17.5))
    ]
    found = node("optics.js", f"""
        const field = {json.dumps(data)}, cases = {json.dumps(cases)};
        console.log(JSON.stringify(cases.map((one) =>
          openViews(field, changed(field, initial(field), one)).map((entry) => entry.view))));
    """)  # fmt: skip
    for case, views in zip(cases, found, strict=True):
        plane = field.plane(
            aperture_views=case["a"], aperture=case["shape"], blades=case["blades"],
            rotation_deg=case["turn"],
        )  # fmt: skip
        assert isinstance(plane.lens_aperture(SLAB), Aperture)
        assert views == np.flatnonzero(plane.mask(SLAB)).tolist(), case


def test_a_link_holds_the_state_and_nonsense_does_no_harm(page, field):
    data = described(page.read_text()) | {"atlas": {}, "map": None}
    start, back, odd, far = node("optics.js", f"""
        const field = {json.dumps(data)}, start = initial(field);
        const state = changed(field, start,
          {{x: -1.5, d: 0.25, shape: "polygon", blades: 5, epi: true, filter: "nearest"}});
        console.log(JSON.stringify([start, [state, fromHash(field, "#" + toHash(field, state))],
          fromHash(field, "#x=NaN&shape=star&d=&nothing=1&__proto__=2&a=-9"),
          [distance(field, 0.5), fNumber(field, 4.5)]]));
    """)  # fmt: skip
    assert back[0] == back[1] and back[0]["x"] == -1.5 and back[0]["epi"] is True
    assert odd == start | {"a": 0.5, "d": 0}
    assert far == pytest.approx([field.distance_of(0.5), 4.0])


def test_the_scripts_types_agree():
    tsc = shutil.which("tsc")
    if tsc is None:
        pytest.skip("no tsc: the types in the page's scripts are not checked")
    options = "--noEmit --allowJs --checkJs --strict --target es2022 --lib es2022,dom,dom.iterable"
    files = [str(path) for path in sorted(FOLDER.glob("*.js"))]
    done = subprocess.run([tsc, *options.split(), *files], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout


def test_an_array_that_is_no_slab_is_refused_in_one_line(field):
    class NoSlab(LightField):
        slab = None

    broken = NoSlab.__new__(NoSlab)
    broken.__dict__.update(field.__dict__)
    with pytest.raises(Exception, match="holds a camera array that is no slab"):
        broken.viewer()


SIZE = 40, 30
CLOSE, DISTANT = 3.2, -1.3


def square_and_wall(columns: int, rows: int) -> tuple[Neighbours, np.ndarray, np.ndarray]:
    """A square before a wall, both textured, with displaced pixels: grid, colours, disparities."""
    s, t = np.arange(columns) - 1.25, 1.5 * np.arange(rows) - 2
    displaced = np.random.default_rng(3).uniform(-0.5, 0.5, (columns * rows, 2)).round(6)
    step, (width, height) = 0.4, SIZE
    grid = Neighbours(s, t, displaced, DISTANT, step, round((CLOSE - DISTANT) / step) + 1)
    places = np.stack(np.meshgrid(s, t), -1).reshape(-1, 2)
    y, x = np.mgrid[:height, :width]
    colours, disparities = [], []
    for place, moved in zip(places, displaced, strict=True):
        here = np.stack([x + moved[0] - width / 2, y + moved[1] - height / 2])
        square, wall = (here + place[:, None, None] * d for d in (CLOSE, DISTANT))
        within = np.abs(square).max(0) < 8
        waves = [
            0.5 + 0.2 * np.sin(0.3 * at[0] + phase) + 0.2 * np.cos(0.2 * at[1])
            for at, phase in ((square, 0), (wall, 2))
        ]
        shown = np.where(within, *waves)[..., None] * np.where(within[..., None], [1, 0.8, 0.3], 1)
        colours.append(np.rint(255 * shown).astype(np.uint8))
        disparities.append(np.where(within, CLOSE, DISTANT))
    return grid, np.stack(colours), np.stack(disparities)


def coded(grid: Neighbours, colours: np.ndarray, codes: np.ndarray, gain: int, **coding):
    """Levels, with the atlas of each."""
    levels = grid.levels()
    atlases, *_ = grid.coded_colours(colours, codes, partial(encode, **coding), gain, levels)
    return list(zip(levels, atlases, strict=True))


def undone(grid: Neighbours, levels, differences: np.ndarray, gain: int):
    """Codes and colours as lfcore/viewer/neighbours.js makes them."""
    width, height = SIZE
    shape = len(differences), height, width, 3
    field = {"columns": grid.columns.tolist(), "rows": grid.rows.tolist()}
    field |= {"width": width, "height": height}
    depth = {"codes": grid.codes, "low": grid.low, "step": grid.step}
    depth["displaced"] = grid.displaced.tolist()
    given = [
        [view, other, differences[view].ravel().tolist(),
         np.pad(picture, ((0, 0), (0, 0), (0, 1))).ravel().tolist()]
        for level, atlas in levels
        for one, picture in zip(level, atlas.decoded((len(level), *shape[1:])), strict=True)
        for view, other in [one]
    ]  # fmt: skip
    codes, shown = node("neighbours.js", f"""
        const field = {json.dumps(field)}, depth = {json.dumps(depth)}, codes = [], shown = [];
        for (const [view, other, differences, colours] of {json.dumps(given)}) {{
          codes[view] = Uint8Array.from(differences);
          shown[view] = Uint8ClampedArray.from(colours);
          if (view === other) continue;
          let move = apart(field, depth, other, view, 1);
          addDepth(codes[view], codes[other], move, depth.codes, field);
          move = apart(field, depth, view, other, PARTS);
          addColours(shown[view], shown[other], codes[view], move, {gain}, field);
        }}
        const lists = (all) => all.map((one) => Array.from(one));
        console.log(JSON.stringify([lists(codes), lists(shown)]));
    """)  # fmt: skip
    codes, shown = (np.array(each, np.uint8) for each in (codes, shown))
    return codes.reshape(shape[:3]), shown.reshape(*shape[:3], 4)[..., :3]


@pytest.mark.parametrize(("columns", "rows"), [(4, 4), (3, 5), (1, 2)])
def test_the_page_undoes_what_was_coded(columns, rows):
    grid, colours, disparities = square_and_wall(columns, rows)
    codes, differences = grid.coded_depth(disparities)
    assert np.abs(grid.low + grid.step * codes - disparities).max() <= TOLERANCE * grid.step
    levels = coded(grid, colours, codes, 1, format="webp", jpeg_quality=100)
    assert sorted(view for level, _ in levels for view, _ in level) == list(range(columns * rows))
    found, shown = undone(grid, levels, differences, 1)
    np.testing.assert_array_equal(found, codes)
    np.testing.assert_array_equal(shown, colours)
    if (columns, rows) == (4, 4):  # most depths are as predicted
        others = np.delete(differences, grid.levels()[0][0][0], 0)
        assert (others > 0).mean() < 0.05


def test_errors_do_not_add_up():
    """Of a lossy code, some neighbours from the first view: the sum would be larger."""
    grid, colours, disparities = square_and_wall(5, 3)
    codes, differences = grid.coded_depth(disparities)
    levels = coded(grid, colours, codes, 2, format="jpeg", jpeg_quality=85)
    _, shown = undone(grid, levels, differences, 2)
    error = np.square(shown.astype(float) - colours).mean((1, 2, 3))
    near, far = ([error[view] for view, _ in levels[k][0]] for k in (1, -1))
    assert max(far) < 2.5 * np.mean(near)
