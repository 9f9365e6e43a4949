"""Draws the figures of docs/optics.md and docs/architecture.md.

python -m docs.pictures.figures
"""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from lfcore.colour import srgb_encode
from lfcore.optics.camera import Camera, image_distance
from lfcore.optics.lens import Lens
from lfcore.optics.planes import SensorPlane
from lfcore.optics.ray_cells import displaced_views
from lfcore.optics.slab import Slab
from lfcore.refocus.depth_slicing import DepthSlicer

FOLDER = Path(__file__).parent
BLUE, RED, GREEN, GREY = "#2a63b0", "#c0392b", "#2e7d4f", "#555555"
SLAB = Slab(Camera(0.5, 0.4, 1.0, 2.0), 9, 9)
"""A wide lens with few views, so that the drawings are clear; focused at 2 m."""


def parametrisation(axes) -> None:
    """Rays of three lens points and three pixels, which meet in the plane of focus."""
    delta, z = SLAB.camera.delta, np.array([0.0, 2.9])
    lens = (np.array([0, 4, 8]) - 4) * SLAB.lens_pitch_m
    tangents = (np.array([1, 4, 7]) - 4) * SLAB.pixel_pitch
    for tangent, colour in zip(tangents, (BLUE, GREY, RED), strict=True):
        for s in lens:
            axes.plot(z, s * (1 - z * delta) + z * tangent, color=colour, linewidth=0.9)
        axes.plot(2.0, 2.0 * tangent, "o", color=colour)
    axes.plot([0, 0], [-0.27, 0.27], color="black", linewidth=3)
    axes.plot(np.zeros(9), SLAB.lens_positions(), "o", color="white", ms=3.5, mec="black")
    axes.axvline(2.0, color=GREEN, linestyle="--")
    axes.text(1.97, -0.64, "in focus, d = 2 m", color=GREEN, ha="right")
    axes.text(0.05, 0.31, "lens: s")
    axes.text(2.6, 0.34, "pixel u", color=RED)
    axes.text(2.6, -0.33, "pixel u'", color=BLUE)
    axes.set(xlabel="depth z, m", ylabel="x, m", ylim=(-0.7, 0.75))


def disparity(axes) -> None:
    """The disparity of points over their depth, in pixels per view."""
    z = np.linspace(1.0, 8.0, 200)
    px = (1 / z - SLAB.camera.delta) * SLAB.lens_pitch_m / SLAB.pixel_pitch
    axes.plot(z, px, color=BLUE)
    axes.axhline(0, color=GREEN, linestyle="--")
    axes.plot(2.0, 0, "o", color=GREEN)
    axes.text(2.15, 0.05, "in focus: 0", color=GREEN)
    far = -SLAB.camera.delta * SLAB.lens_pitch_m / SLAB.pixel_pitch
    axes.axhline(far, color=GREY, linestyle=":")
    axes.text(4.2, far + 0.04, "infinity", color=GREY)
    axes.set(xlabel="depth z, m", ylabel="disparity, pixels")


def epipolar(axes) -> None:
    """Lines of points over views: refocusing is a shear."""
    views = np.arange(9) - 4
    for u, slope, colour, name in (
        (2.0, 0.45, RED, "near"), (4.5, 0.0, GREEN, "in focus"), (7.0, -0.3, BLUE, "far"),
    ):  # fmt: skip
        axes.plot(u - slope * views, views, "o-", color=colour, ms=4)
        axes.text(u + 0.12, 4.35, name, color=colour, ha="center")
    axes.set(xlabel="pixel u", ylabel="view i", xlim=(-0.5, 9), ylim=(-4.6, 5.0))


def apertures(figure) -> None:
    """The masks over the lens samples of a slab of 33 x 33 views."""
    many = Slab(SLAB.camera, 33, 1)
    shapes = (
        ("circle, f/1", SensorPlane(2.0, 1.0)), ("circle, f/2", SensorPlane(2.0, 2.0)),
        ("square, f/1.5", SensorPlane(2.0, 1.5, "square")),
        ("polygon of 6, f/1.2", SensorPlane(2.0, 1.2, "polygon", 6, 10.0)),
    )  # fmt: skip
    for axes, (name, plane) in zip(figure.subplots(1, 4), shapes, strict=True):
        places = many.lens_positions()
        opened = plane.lens_aperture(many).contains(places[None, :], places[:, None])
        axes.imshow(opened, cmap="Greys_r", vmin=-0.3, vmax=1.1)
        axes.set_title(name, fontsize=10)
        axes.set(xticks=[], yticks=[])


def blur(axes) -> None:
    """The diameter of a point's blur over depth, for three apertures, and the gap between views."""
    one = Slab(Camera(0.085, 0.036, 1.2, 3.0), 16, 512)
    z = np.linspace(1.5, 9.0, 300)
    apart = np.abs(1 / z - 1 / 3)
    for number, colour in ((1.2, RED), (2.8, BLUE), (8.0, GREEN)):
        width = one.camera.focal_length_m / number
        axes.plot(z, apart * width / one.pixel_pitch, color=colour, label=f"f/{number:g}")
    gap = apart * one.lens_pitch_m / one.pixel_pitch
    axes.plot(z, gap, color=GREY, linestyle="--", label="between two of 16 views, f/1.2")
    axes.axhline(1, color="black", linewidth=0.7)
    axes.text(9.4, 1, "one pixel", fontsize=9, va="center")
    axes.set(xlabel="depth z, m", ylabel="blur, pixels", ylim=(0, 30))
    axes.legend()


STAGES = [
    ("traversal", "packet of rays", "leaves, nearest first"),
    ("coverage", "edge functions, depth", "regions"),
    ("surface", "plane equations", "samples"),
    ("shadows", "shafts, occluders", "shadow masks"),
    ("shading", "Blinn-Phong, GGX", "colours"),
    ("output", "write rows", "light, depth"),
]


def bokeh(figure) -> None:
    """Points of light out of focus: blades, cat's eyes of a double Gauss, rings of a magnifier."""
    panels = (
        ("six blades, a perfect lens", None, 2.1, 0.35, 9.0, "polygon", 0.72),
        ("double Gauss, f/2.1, behind the focus", "dgauss.dat", 2.1, 0.35, 9.0, "circle", 0.72),
        ("magnifying glass, f/2.8, before the focus", "singlet.dat", 2.8, 4.0, 0.5, "circle", 0.2),
    )
    for axes, (name, file, f_number, focus, depth, shape, field) in zip(
        figure.subplots(1, 3), panels, strict=True
    ):
        lens = file and Lens.read(FOLDER.parents[1] / "scenes" / "lenses" / file).colours[0]
        plane = SensorPlane(focus, f_number, shape, lens=lens)
        camera = Camera(0.05, field * image_distance(0.05, focus), f_number, focus)
        views, apart = displaced_views(Slab(camera, 16, 192)), field * depth / 5
        slicer = DepthSlicer(views, [plane], 192)
        for k in range(16**2):
            origin, way = views.bundles(slice(k, k + 1)).rays()
            at = ((origin + depth * way)[..., :2] + apart / 2) % apart - apart / 2
            light = np.float32(np.hypot(at[..., 0], at[..., 1]) < 0.06 * apart)
            light = np.repeat(light[..., None], 3, -1)
            slicer.add(slice(k, k + 1), light, np.full(light.shape[:3], np.float32(depth)))
        picture = slicer.pictures()[0]
        axes.imshow(srgb_encode(picture / picture.max()))
        axes.set_title(name, fontsize=10)
        axes.axis("off")


def way_of_a_block(axes) -> None:
    """The stages of a block, from rays to light and depth."""
    for k, (name, inside, out) in enumerate(STAGES):
        x = 1.8 * k
        axes.add_patch(plt.Rectangle((x, 0), 1.25, 1, facecolor="#e8eef7", edgecolor="#345"))
        axes.text(x + 0.625, 0.66, f"{name}/", ha="center", weight="bold", fontsize=11)
        axes.text(x + 0.625, 0.3, inside.replace(", ", ",\n"), ha="center", va="center", fontsize=8)
        axes.annotate("", (x + 1.8, 0.5), (x + 1.25, 0.5), arrowprops={"arrowstyle": "->"})
        axes.text(x + 1.52, -0.32, out.replace(", ", ",\n"), ha="center", fontsize=9, color="#a40")
        axes.plot([x + 1.52, x + 1.52], [-0.12, 0.46], color="#a40", linewidth=0.8, linestyle=":")
    axes.text(3.05, 1.25, "surfaces and shadows know triangles only by regions", fontsize=9)
    axes.plot([3.32, 3.32], [0.55, 1.2], color="#a40", linewidth=0.8)
    axes.axis("off")
    axes.set(xlim=(-0.1, 11.4), ylim=(-0.55, 1.5))


def main() -> None:
    # The same bytes whenever it is drawn.
    plt.rcParams |= {"svg.hashsalt": "lfcore", "font.size": 10}
    for name, draw, size in (
        ("optics_rays.svg", parametrisation, (7, 3.6)),
        ("optics_disparity.svg", disparity, (6, 3.2)),
        ("optics_epipolar.svg", epipolar, (6, 3.2)), ("optics_blur.svg", blur, (6.5, 3.4)),
        ("way_of_a_block.png", way_of_a_block, (11, 3)),
    ):  # fmt: skip
        figure, axes = plt.subplots(figsize=size)
        draw(axes)
        axes.spines[["top", "right"]].set_visible(False)
        _save(figure, name)
    figure = plt.figure(figsize=(9, 2.5))
    apertures(figure)
    _save(figure, "optics_apertures.svg")
    figure = plt.figure(figsize=(12, 4.3))
    bokeh(figure)
    _save(figure, "optics_bokeh.png")


def _save(figure, name: str) -> None:
    figure.tight_layout()
    dpi = 110 if name.endswith(".png") else "figure"
    figure.savefig(FOLDER / name, dpi=dpi, metadata={"Date": None})
    plt.close(figure)


if __name__ == "__main__":
    main()
