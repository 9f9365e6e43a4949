"""Cameras and names of others: a painted wall at 1 m is sharp there, or a note says why not."""

import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from plain_scenes import refused

from lfcore import Encoding
from lfcore.colour import srgb_codes
from lfcore.exchange.importing import import_lightfield
from lfcore.exchange.lenses import Lens

WIDTH, HEIGHT, FOCAL, STEP = 64, 48, 80.0, 0.02
PLACES = [((i - 1) * STEP, (j - 1) * STEP) for j in range(3) for i in range(3)]


def view(x, y, lens=None):
    """uint8 of a wall at 1 m, seen from x to the right and y down through a lens."""
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH] + 0.5
    across, down = (u - WIDTH / 2) / FOCAL, (v - HEIGHT / 2) / FOCAL
    if lens:
        for _ in range(60):  # directions whose pixels are these
            at = lens.seen(across, down)
            across, down = (
                across - (at[0] - u) / lens.focal[0],
                down - (at[1] - v) / lens.focal[1],
            )
    a, b = x + across, y + down
    third = np.cos(31 * a) * np.sin(19 * a + 27 * b)
    waves = np.sin(37 * a + 5 * b), np.sin(29 * b - 11 * a), third
    return np.rint(127.5 + 100 * np.stack(waves, -1)).astype(np.uint8)


def pose(x, y):
    matrix = np.eye(4)
    matrix[:2, 3] = x, -y
    return matrix


def nerfstudio(folder, lens=None, name="images/{}.png", **given):
    frames = []
    (folder / "images").mkdir()
    for k, (x, y) in enumerate(PLACES):
        Image.fromarray(view(x, y, lens)).save(folder / name.format(k))
        frames.append({"file_path": name.format(k), "transform_matrix": pose(x, y).tolist()})
    given = {"fl_x": FOCAL, "fl_y": FOCAL, "w": WIDTH, "h": HEIGHT} | given
    (folder / "transforms.json").write_text("\ufeff" + json.dumps(given | {"frames": frames}))


def colmap(folder, camera, lens=None, name="{}.png", between="\n"):
    model = folder / "sparse" / "0"
    model.mkdir(parents=True)
    (folder / "images").mkdir()
    lines = []
    for k, (x, y) in enumerate(PLACES):
        Image.fromarray(view(x, y, lens)).save(folder / "images" / name.format(k))
        lines.append(f"{k + 1} 1 0 0 0 {-x} {-y} 0 1 {name.format(k)}\n{between}")
    (model / "cameras.txt").write_text(f"\n # of all\n1 {camera}\n\n")
    (model / "images.txt").write_text("\n  # of all\n" + "".join(lines))


def imported(folder):
    """The light field and its notes."""
    field = import_lightfield(folder, folder / "out" / "lf.mkv", encoding=Encoding("ffv1"))
    return field, " ".join(field.metadata.content["source"].get("notes", []))


def check_sharp(field, expected=None, least=35.0):
    """The wall at 1 m, seen from the middle."""
    found = srgb_codes(field.refocus(focus_m=1.0))[8:-8, 8:-8].astype(float)
    expected = (view(0, 0) if expected is None else expected)[8:-8, 8:-8]
    assert 10 * np.log10(255**2 / np.mean((found - expected) ** 2)) > least


BENT = {"k1": -0.3, "k2": 0.05, "k4": 0.2, "p1": 0.01, "p2": -0.02}
ROUND = {"k1": 0.1, "k2": -0.05, "k3": 0.01, "k4": 0.3}


@pytest.mark.parametrize("fisheye", [False, True])
def test_distortion_is_undone(tmp_path, fisheye):
    terms = ROUND if fisheye else BENT
    numbers = {"f": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2, **terms}
    model = {"camera_model": "OPENCV_FISHEYE"} if fisheye else {}
    nerfstudio(tmp_path, Lens.of(numbers, None, fisheye), **terms, **model)
    field, notes = imported(tmp_path)
    assert "distortion was undone" in notes
    check_sharp(field)


def test_a_lens_of_opencv_projects_as_opencv_does():
    import cv2

    points = np.random.default_rng(1).uniform(-0.6, 0.6, (50, 3)) * [1, 1, 0] + [0, 0, 1]
    matrix = np.array([[80.0, 0, 30], [0, 90, 20], [0, 0, 1]])
    numbers = {"fx": 80.0, "fy": 90.0, "cx": 30.0, "cy": 20.0}
    factors = [0.1, -0.02, 0.01, -0.01, 0.03, 0.2, 0.01, 0.02]
    names = "k1 k2 p1 p2 k3 d1 d2 d3".split()
    plain = Lens.of(numbers | dict(zip(names, factors, strict=True)), None)
    expected = cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, np.array(factors))[0]
    found = np.stack(plain.seen(points[:, 0], points[:, 1]), -1)
    np.testing.assert_allclose(found, expected[:, 0], atol=1e-6)
    terms = {f"k{k + 1}": factors[k] for k in range(4)}
    round_ = Lens.of(numbers | terms, None, True)
    bent = cv2.fisheye.distortPoints(points[:, None, :2], matrix, np.array(factors[:4]))
    found = np.stack(round_.seen(points[:, 0], points[:, 1]), -1)
    np.testing.assert_allclose(found, bent[:, 0], atol=1e-6)


@pytest.mark.parametrize("scale", [2, 0.5])
@pytest.mark.parametrize("make", [nerfstudio, colmap])
def test_lenses_are_scaled_to_the_pictures(tmp_path, make, scale):
    w, h, f = (round(scale * size) for size in (WIDTH, HEIGHT, FOCAL))
    if make is nerfstudio:
        nerfstudio(tmp_path, fl_x=f, fl_y=f, w=w, h=h, cx=w / 2, cy=h / 2)
    else:
        colmap(tmp_path, f"PINHOLE {w} {h} {f} {f} {w / 2} {h / 2}")
    field, notes = imported(tmp_path)
    assert "focal lengths were scaled" in notes
    assert 1 / field.slab.pixel_pitch == pytest.approx(FOCAL)
    check_sharp(field)


def test_pixels_become_square(tmp_path):
    numbers = {"fx": FOCAL, "fy": 1.25 * FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2}
    nerfstudio(tmp_path, Lens.of(numbers, None), fl_y=1.25 * FOCAL)
    field, notes = imported(tmp_path)
    assert "not square" in notes and 1 / field.slab.pixel_pitch == pytest.approx(1.25 * FOCAL)
    both = Lens.of(numbers | {"fx": 1.25 * FOCAL}, None)
    check_sharp(field, view(0, 0, both))


@pytest.mark.parametrize("between", ["", "\n", "1.5 2 -1 3.5 4 7\n", "\n\n"])
def test_colmaps_lines(tmp_path, between):
    """Names with spaces, lines of points, and empty lines that an editor dropped or added."""
    colmap(tmp_path, "SIMPLE_PINHOLE 64 48 80 32 24", name="view no {}.png", between=between)
    field, notes = imported(tmp_path)
    assert not notes
    check_sharp(field)


def test_cameras_that_are_none_are_refused(tmp_path):
    for model in ("EQUIRECTANGULAR", ["list"]):
        folder = tmp_path / str(len(model))
        folder.mkdir()
        nerfstudio(folder, camera_model=model)
        refused("camera_model: .* is none of", imported, folder)
    for k, wrong in enumerate(({"w": 99}, {"fl_y": -1}, {"fl_y": 800}, {"cx": "left"})):
        (tmp_path / f"w{k}").mkdir()
        nerfstudio(tmp_path / f"w{k}", **wrong)
        refused("scaled copy|not positive|differ too much", imported, tmp_path / f"w{k}")


def test_llff_pairs_poses_with_sorted_names(tmp_path):
    (tmp_path / "images").mkdir()
    names = [f"img{k + 1}.png" for k in range(12)]
    rows = {}
    for k, name in enumerate(names):
        x, y = (k % 3 - 1) * STEP, (k // 3 - 1.5) * STEP
        Image.fromarray(view(x, y)).save(tmp_path / "images" / name)
        m, size = pose(x, y)[:3], np.array([HEIGHT, WIDTH, FOCAL])
        matrix = np.stack([-m[:, 1], m[:, 0], m[:, 2], m[:, 3], size], 1)
        rows[name] = np.append(matrix.ravel(), (0.9, 1.1))
    np.save(tmp_path / "poses_bounds.npy", np.array([rows[name] for name in sorted(names)]))
    field, notes = imported(tmp_path)
    assert "img1.png, img10.png" in notes
    check_sharp(field, view(-STEP / 2, 0))


@pytest.mark.parametrize(
    ("name", "exchanged"),
    [
        ("2024-05-01_{n}", False), ("scan_20240501_{n:02d}", False), ("scan_2024_{n}", False),
        ("x{i}_y{j}", False), ("row{j}-col{i}", False), ("r{j}c{i}_20240501", False),
        ("a_{n}_{j}_{i}", False), ("{i}_{j}", True),
    ],
)  # fmt: skip
def test_numbers_of_names(tmp_path, name, exchanged):
    """Dates are no rows; words say what numbers count; an exchange is noticed by parallax."""
    for k, (x, y) in enumerate(PLACES):
        stem = name.format(n=k + 1, i=k % 3, j=k // 3)
        Image.fromarray(view(x, y)).save(tmp_path / f"{stem}.png")
    field, notes = imported(tmp_path)
    assert field.grid == (3, 3)
    assert ("exchanged" in notes) == exchanged
    expected = view(-STEP, STEP) if exchanged else view(STEP, -STEP)
    np.testing.assert_array_equal(field.view(2, 0, codes=True), expected)


def test_a_single_row_is_one(tmp_path):
    for k in range(9):
        Image.fromarray(view(k * STEP, 0)).save(tmp_path / f"00_{k:02d}.png")
    field, notes = imported(tmp_path)
    assert field.grid == (9, 1) and "exchanged" not in notes
    (tmp_path / "down").mkdir()
    for k in range(9):
        Image.fromarray(view(0, k * STEP)).save(tmp_path / "down" / f"00_{k:02d}.png")
    assert "exchanged" in imported(Path(tmp_path / "down"))[1]
