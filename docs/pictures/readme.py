"""Draws the pictures of README.md: the film refocus.webp, viewer.png, lit.webp and mirror.webp.

python -m docs.pictures.readme
"""

import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from PIL import Image

import lfcore
from docs.examples.sky import sky
from lfcore.colour import srgb_codes
from lfcore.pictures import write_picture
from lfcore.scene.model import Animation
from lfcore.scene.transforms import look_at, rotate
from tests.viewer.viewer_browser import chromium, visit

HERE = Path(__file__).parent
SCENES = HERE.parents[1] / "scenes"
LIT_PIXELS = 288
MIRROR_PIXELS, MIRROR_EV = 448, 1.5
"""Pixels of each picture of the mirror, and the stops by which its dim room is brighter."""
PIXELS = 400
"""Pixels of the light field, and of the film's pictures."""
FPS, COUNT, F_NUMBER = 24, 35, 1.4
"""The film's instants per second and their number, and the aperture of its pictures."""
FIRST = 15
"""The picture with which the film begins, and which is shown where it does not move."""
BACK = 12
"""The pictures of the last instant, whose focus returns to the flowers at 2.3 m."""
CAMERA = (-0.1, 1.15, 3.75), (0.04, 0.69, 0.0)
"""The position of bike's camera, and the point that it looks at, metres."""
BOUNCES = np.array([
    (0.0, -0.62, 0.62, 2.35, 0.1), (0.3, -0.3, 0.13, 1.35, 1.35), (0.92, 1.0, 0.13, -0.8, 0.22),
    (1.2, 1.25, 0.13, -1.35, 0.0), (1.42, 1.4, 0.13, -1.7, 0.0),
])  # fmt: skip
"""Seconds, where the ball is then (x to the right, y up, z to the camera), and how high it flies
before the next, metres."""


def ball_at(time_s: float) -> np.ndarray:
    """The ball's place in the world, (3,) metres."""
    row = np.clip(np.searchsorted(BOUNCES[:, 0], time_s, "right") - 1, 0, len(BOUNCES) - 2)
    (start, *here, height), (end, *there, _) = BOUNCES[row : row + 2]
    share = min((time_s - start) / (end - start), 1.0)
    place = (1 - share) * np.array(here) + share * np.array(there)
    return place + (0, 4 * height * share * (1 - share), 0)


def flying(scene: lfcore.Scene) -> lfcore.Scene:
    """The scene ``bike/ball.yaml``, whose ball bounces over the bicycle."""
    (motion,), to_camera = scene.motions, look_at(*CAMERA)
    rows = slice(motion.first, motion.first + motion.count)
    corners = scene.triangles[rows].reshape(-1, 3).astype(np.float64)
    middle = (corners.min(0) + corners.max(0)) / 2

    def at(now: lfcore.Scene, time_s: float) -> lfcore.Scene:
        turn = rotate("x", -400 * time_s) @ rotate("z", -90 * time_s)
        turn = (to_camera @ turn @ np.linalg.inv(to_camera))[:3, :3]
        triangles, normals = now.triangles.copy(), now.normals.copy()
        triangles[rows] = (triangles[rows] - middle) @ turn.T + _in_camera(ball_at(time_s))
        normals[rows] = normals[rows] @ turn.T
        return replace(now, triangles=triangles, normals=normals)

    return replace(scene, motions=(), animation=Animation(0.0, COUNT / FPS, at))


def _in_camera(place: np.ndarray) -> np.ndarray:
    return (look_at(*CAMERA) @ np.append(place, 1.0))[:3]


def film(folder: Path) -> None:
    """Focus follows the ball from the flowers to the house, and returns."""
    scene = flying(lfcore.load_scene(SCENES / "bike" / "ball.yaml")).exposed(0, 0.5 / FPS)
    times = [k / FPS for k in range(COUNT)]
    field = lfcore.record(scene, folder / "film.mkv", times=times, pixels=PIXELS)
    print(f"film: {field.path.stat().st_size:,} bytes")
    focus = [float(_in_camera(ball_at(time))[2]) for time in times]
    keys = [(t, field.plane(z, F_NUMBER)) for t, z in zip(times, focus, strict=True)]
    back = 1 / np.linspace(1 / focus[-1], 1 / 2.3, BACK)
    last = field.at(-1).refocus_many([field.plane(z, F_NUMBER) for z in back.tolist()])
    frames = [Image.fromarray(srgb_codes(one)) for one in (*field.pull(keys), *last)]
    durations = [600 if k in (COUNT - 1, len(frames) - 1) else 60 for k in range(len(frames))]
    frames, durations = (each[FIRST:] + each[:FIRST] for each in (frames, durations))
    frames[0].save(HERE / "refocus.webp", save_all=True, append_images=frames[1:],
                   duration=durations, loop=0, quality=84, method=6,
                   kmin=0, kmax=1)  # whole frames, no blocks  # fmt: skip


def lit(folder: Path) -> None:
    """A room lit through its window, a bicycle under a panorama, and a box with a lamp."""
    write_picture(folder / "sky.exr", sky())
    light = {"sky": {"file": str(folder / "sky.exr")}}
    scenes = [
        lfcore.load_scene(SCENES / "bedroom" / "window.yaml"),
        lfcore.load_scene(SCENES / "bike" / "sky.yaml", light=light),
        lfcore.load_scene(SCENES / "cornell"),
    ]
    row = []
    for number, scene in enumerate(scenes):
        file = folder / f"{number}.png"
        picture = lfcore.render(scene, pixels=LIT_PIXELS, quality=lfcore.Quality(42))
        write_picture(file, picture, roll_off=True)
        row.append(np.asarray(Image.open(file)))
    Image.fromarray(np.hstack(row)).save(HERE / "lit.webp", quality=88, method=6)


def mirror(folder: Path) -> None:
    """A room in a mirror: in focus are the mirror's frame, the toys in it, and the bed in it."""
    scene = lfcore.load_scene(SCENES / "bedroom" / "mirror.yaml")
    views = lfcore.Lattice(8, 1)
    field = lfcore.record(scene, folder / "mirror.mkv", views=views, pixels=MIRROR_PIXELS)
    pictures = field.stack(scene.focus_distances_m)
    row = [srgb_codes(lfcore.exposed(picture, MIRROR_EV, roll_off=True)) for picture in pictures]
    Image.fromarray(np.hstack(row)).save(HERE / "mirror.webp", quality=90, method=6)


def screenshot(field: lfcore.LightField, folder: Path) -> None:
    field.viewer().save(folder / "bike.html")
    with chromium(folder / "profile", "--window-size=900,900", "--hide-scrollbars") as browser:
        visit(browser, folder / "bike.html")
        browser.save_screenshot(str(folder / "page.png"))
        high = browser.execute_script("return document.querySelector('main').offsetHeight")
    cv2.imwrite(str(HERE / "viewer.png"), cv2.imread(str(folder / "page.png"))[:high])


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        made = lfcore.record(lfcore.load_scene("scenes/bike"), f"{name}/bike.mkv", pixels=PIXELS)
        lit(Path(name))
        film(Path(name))
        mirror(Path(name))
        screenshot(made, Path(name))
