"""The page of a file with depth in a real browser: its pictures against those of refocusing."""

import shlex

import cv2
import numpy as np
import pytest
from plain_scenes import SCENES, scene, wall
from viewer_browser import before_pages, choose, complaints, opened_at, pixels, psnr, visit

import lfcore
from lfcore import Material, load_scene, record
from lfcore.cli import main
from lfcore.colour import srgb_codes
from lfcore.refocus.depth_slicing import DepthSlicer
from lfcore.refocus.stored_depth import read_rays

LEAST_DB, MOST_OF_FILE = 38, 4

pytestmark = pytest.mark.browser


WIDE = "bike", (160, 90)
wide_alone = pytest.mark.parametrize("field", [WIDE], indirect=True)


@pytest.fixture(scope="module", params=[WIDE, ("cabin", 96), ("bedroom", 128)])
def field(browser, request, tmp_path_factory):
    name, size = request.param
    path = tmp_path_factory.mktemp("field") / f"{name}.mkv"
    return record(load_scene(SCENES / name), path, pixels=size)


@pytest.fixture(scope="module")
def opened(browser, field):
    field.page = field.path.with_suffix(".html")
    field.viewer().save(field.page)
    yield from opened_at(browser, field.page)


class MovedAperture:
    """An aperture beside the middle of the lens, as :class:`lfcore.optics.planes.Aperture`."""

    def __init__(self, slab, aperture, x: float, y: float):
        self.radius_m = slab.camera.lens_radius_m
        self._own, self._middle = aperture, (x * slab.lens_pitch_m, y * slab.lens_pitch_m)

    def contains(self, s, t):
        return self._own.contains(s - self._middle[0], t - self._middle[1])


def from_beside(field, plane, x: float, y: float) -> np.ndarray:
    """The picture of ``plane`` with its aperture (x, y) views beside the middle of the lens."""
    aperture = MovedAperture(field.slab, plane.lens_aperture(field.slab), x, y)

    class MovedPlane(type(plane)):
        def lens_aperture(self, slab):
            return aperture

    moved = MovedPlane(plane.focus_m, plane.f_number, plane.aperture)
    stored = field.metadata.depth
    slicer = DepthSlicer(stored.views(field.slab), [moved], stored.pixels)
    slicer.add(slice(None), *read_rays(field, device=slicer.device))
    return slicer.pictures()[0] * field.white


def states(field) -> list[dict]:
    near, far = (field.disparity_of(end) for end in field.depth_range)
    middle = (near + far) / 2
    return [
        {"d": 0, "a": 4}, {"d": near, "a": 4}, {"d": far, "a": 4, "shape": "square"},
        {"d": middle, "a": 4, "shape": "diamond"}, {"d": near, "a": 2.3}, {"d": far, "a": 1},
        {"d": middle, "a": 3, "shape": "polygon", "blades": 5, "turn": 20},
        {"d": far, "a": 2, "x": 1, "y": -0.7}, {"d": near, "a": 1.5, "x": -1.2, "y": 0.4},
        {"single": True, "x": 0.8, "y": -1.1},
    ]  # fmt: skip


def wanted(field, state: dict) -> np.ndarray:
    if state.get("single"):
        point = np.array([[state["x"], state["y"]]]) * field.slab.lens_pitch_m
        return field.views_at(point)[0]
    plane = field.plane(
        disparity_px=state["d"], aperture_views=state["a"], aperture=state.get("shape", "circle"),
        blades=state.get("blades", 6), rotation_deg=state.get("turn", 0),
    )  # fmt: skip
    if "x" in state:
        return from_beside(field, plane, state["x"], state["y"])
    return field.refocus_many([plane])[0]


def test_the_page_shows_what_refocus_makes(opened, field):
    start = {"shape": "circle", "single": False, "x": 0, "y": 0}
    found = []
    for state in states(field):
        choose(opened, **(start | state))
        found.append(psnr(pixels(opened), srgb_codes(wanted(field, state))))
        print(field.path.stem, state, f"{found[-1]:.1f} dB")
    assert min(found) >= LEAST_DB, found


def test_a_page_is_at_most_four_times_the_file(field):
    assert len(field.viewer().html) <= MOST_OF_FILE * field.path.stat().st_size


@wide_alone
def test_a_graphics_card_without_sums_shows_single_views(opened, field):
    refusal = "WebGL2RenderingContext.prototype.getExtension = () => null"
    with before_pages(opened, refusal):
        visit(opened, field.page)
        assert "only single views are shown" in opened.find_element("id", "status").text
        choose(opened, x=-1.5, y=0.5)
        assert psnr(pixels(opened), field.view(0, 2, codes=True)) > 30
    visit(opened, field.page)


@wide_alone
def test_the_command_makes_the_picture_that_is_shown(opened, field, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / field.path.name).symlink_to(field.path)
    for state in ({"d": field.disparity_of(field.depth_range[0]), "a": 3, "single": False},
                  {"single": True, "x": 0.8, "y": -1.1}):  # fmt: skip
        choose(opened, **({"shape": "circle", "x": 0, "y": 0} | state))
        words = shlex.split(opened.find_element("id", "command").text)
        assert words[0] == "lfcore" and main(words[1:]) == 0
        assert psnr(pixels(opened), cv2.imread("picture.png")[..., ::-1]) >= LEAST_DB


@wide_alone
def test_the_old_picture_stays_until_the_new_one_is_drawn(opened):
    """Canvases seen by the browser at every frame of a change are whole pictures."""
    choose(opened, d=0, a=4, single=False, shape="circle", x=0, y=0)
    seen = opened.execute_async_script("""
        const done = arguments[0], seen = [], canvas = lightFieldViewer.canvas;
        const copy = document.createElement("canvas").getContext("2d", {willReadFrequently: true});
        lightFieldViewer.learn = () => {};  // as slow as can be: one view at a time
        lightFieldViewer.cost = 1e6;
        lightFieldViewer.set({d: 1});
        const next = () => {
          copy.drawImage(canvas, 0, 0, 16, 16);
          const data = copy.getImageData(0, 0, 16, 16).data;
          seen.push(data.filter((_, k) => k % 4 < 3 && data[k] > 4).length);
          if (!lightFieldViewer.whole) { requestAnimationFrame(next); return; }
          delete lightFieldViewer.learn;
          done(seen);
        };
        requestAnimationFrame(next);
    """)
    assert len(seen) > 16 and min(seen) > 0.9 * max(seen)


@pytest.mark.parametrize("encoding", [{}, {"depth": False, "layout": "views"}])
def test_the_page_exposes_what_refocus_makes(browser, tmp_path, encoding):
    camera = lfcore.Camera(focal_length_m=0.1, sensor_width_m=0.05, f_number=2.0, focus_m=1.0)
    triangles = np.concatenate(
        [wall(1.2, 0.06) + np.float32([0.1, 0, 0]), wall(1.6, 0.05), wall(3)]
    )
    glow = Material("lamp", (0, 0, 0), emission=(50.0, 30.0, 9.0))
    world = scene(
        triangles, camera=camera, clip=False, material_ids=np.int32([0, 0, 1, 1, 0, 0]),
        materials=[Material("grey", (0.5, 0.4, 0.3)), glow], ambient=(0.6, 0.6, 0.9),
    )  # fmt: skip
    field = lfcore.record(
        world, tmp_path / "a.mkv", pixels=96, views=9 if encoding else None,
        encoding=lfcore.Encoding("ffv1", **encoding),
    )  # fmt: skip
    assert field.layout.peak == 64
    field.viewer(jpeg_quality=100).save(tmp_path / "a.html")
    plane = field.plane(disparity_px=0)
    made = field.refocus_many([plane])[0]
    complaints(browser)
    visit(browser, tmp_path / "a.html")
    for ev in (0, -5):
        choose(browser, d=0, a=field.slab.views, ev=ev)
        found = psnr(pixels(browser), srgb_codes(lfcore.exposed(made, ev)))
        print(f"{ev} stops: {found:.1f} dB")
        assert found >= 36
    assert complaints(browser) == []
