"""Lenses from files: against Optiland, and against rays through the surfaces, one by one."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mirror_room import MIRROR, make_scene, wall
from plain_scenes import refused
from scipy.stats import qmc
from test_depth_slicing import CAMERA, everywhere, grey, noise, seen, sliced

import lfcore
from lfcore import Camera, Lens, SensorPlane, Slab
from lfcore.cli import main
from lfcore.evaluation.metrics import psnr
from lfcore.optics.camera import image_distance
from lfcore.optics.lens import Landing
from lfcore.optics.lens_system import LensSystem
from lfcore.optics.ray_cells import displaced_views
from lfcore.refocus.depth_slicing import DepthSlicer
from lfcore.refocus.lens_views import lens_margin

LENSES = Path(__file__).parents[2] / "scenes" / "lenses"
DGAUSS, WIDE = LENSES / "dgauss.dat", LENSES / "wide.dat"
ASPHERE, PANCAKE = LENSES / "asphere.dat", LENSES / "pancake.dat"
SINGLET = LENSES / "singlet.dat"


@pytest.fixture
def singlet(tmp_path):
    """Biconvex, with a stop behind it: all errors but those of colour are large."""
    path = tmp_path / "singlet.dat"
    path.write_text("50 6 1.5 30\n-50 3 1 30\n0 45 0 20\n")
    return path


def alone(path):
    """The lens for its middle colour."""
    lens = Lens.read(path)
    return lens.colours[len(lens.colours) // 2]


class Ideal(Lens):
    """A lens that takes all rays to their places."""

    def landing(self, points, tangents, focus_m, focal_length_m):
        return Landing(0 * points, points, np.ones(points.shape[:-1]))


def test_a_perfect_lens_gives_the_bits_of_none():
    """Alone, and beside planes with a lens."""
    views, lens = displaced_views(Slab(CAMERA, 4, 48)), Ideal.read(DGAUSS)
    rays = noise(views)
    planes = [
        SensorPlane(6.0, 2.2), SensorPlane(2.2, 4.0, "polygon", keep_magnification=True),
        SensorPlane(3.0, 5.6, half="left", normalise="lens"),
    ]  # fmt: skip
    expected = sliced(views, planes, 24, *rays)
    same = sliced(views, [replace(plane, lens=lens) for plane in planes], 24, *rays)
    assert (same == expected).all()
    mixed = sliced(
        views, [replace(planes[0], lens=Lens.read(DGAUSS), f_number=4.0), planes[1]], 24, *rays
    )
    assert (mixed[1] == expected[1]).all()


def aspheric(system, k):
    """Optiland's keys of surface k, in millimetres."""
    if not system.is_asphere(k):
        return {}
    powers = 1e3 ** (-1.0 - 2 * np.arange(system.even.shape[1]))
    even = (system.even[k] * powers).tolist()
    return {"surface_type": "even_asphere", "conic": system.conic[k], "coefficients": even}


@pytest.mark.slow
@pytest.mark.parametrize("path", [DGAUSS, WIDE, ASPHERE, PANCAKE])
@pytest.mark.parametrize("focus", [np.inf, 1.0])
def test_spots_are_those_of_optiland(path, focus):
    optic_module = pytest.importorskip("optiland.optic")
    from optiland.distribution import create_distribution
    from optiland.materials import IdealMaterial

    lens = alone(path)
    system, focal = lens.systems[lens.colour or 0], lens.focal_length_m
    film, scale = lens.film(focus, focal)
    disk = create_distribution("hexapolar")
    disk.generate_points(12)
    pupil = np.stack([np.asarray(disk.x), np.asarray(disk.y)], -1)
    for tangent in (0.0, 0.1, 0.2, 0.3):
        optic = optic_module.Optic()
        far = np.inf if np.isinf(focus) else 1e3 * (focus - lens.pupil_m)
        optic.surfaces.add(index=0, thickness=far)
        gaps = [*system.thickness_m[:-1], film]
        for k, (radius, gap, index) in enumerate(
            zip(system.radius_m, gaps, system.index, strict=True)
        ):
            optic.surfaces.add(
                **aspheric(system, k), index=k + 1, radius=1e3 * radius or np.inf,
                thickness=1e3 * gap,
                material="air" if index == 1 else IdealMaterial(n=index), is_stop=k == lens.stop,
            )  # fmt: skip
        optic.surfaces.add(index=len(gaps) + 1)
        optic.set_aperture("EPD", 1e3 * focal / 2.8)
        infinite = np.isinf(focus)
        optic.fields.set_type("angle" if infinite else "object_height")
        for y in (0, np.degrees(np.arctan(tangent)) if infinite else 1e3 * tangent * focus):
            optic.fields.add(y=y)
        optic.wavelengths.add(0.55, is_primary=True)
        optic.trace_generic(Hx=0, Hy=1, Px=pupil[:, 0], Py=pupil[:, 1], wavelength=0.55)
        theirs = np.stack([np.array(optic.surfaces.x)[-1], np.array(optic.surfaces.y)[-1]])
        place = np.broadcast_to([0, -tangent if infinite else tangent], pupil.shape)
        ours = lens.landing(pupil * focal / 5.6, place, focus, focal).displacement.T * scale
        spots = [np.sqrt(each.var(axis=1).sum()) for each in (1e3 * ours, theirs)]
        assert spots[0] == pytest.approx(spots[1], rel=0.01, abs=3e-4), tangent


def brute_force(lens, plane, pixels, field, surfaces, chosen, count=4096):
    """Grey light of chosen pixels (row, column), from rays of random film points through the
    surfaces, and their étendue; the lens has its own focal length."""
    focal, rng = lens.focal_length_m, np.random.default_rng(1)
    film, scale = lens.film(plane.focus_m, focal)
    system = lens.systems[lens.colour or 0]
    aperture = system.aperture_m.copy()
    aperture[lens.stop] = focal / (2 * plane.f_number) * system.paraxial(1.0, 0.0, lens.stop)[0]
    gaps = np.append(system.thickness_m[:-1], film)
    system = replace(system, thickness_m=gaps, aperture_m=aperture)
    pupil, light, passed = system.positions_m[0] - lens.pupil_m, [], []
    for row, column in chosen:
        drawn = qmc.Sobol(4, rng=rng).random(count)
        place = ((np.array([column, row]) + drawn[:, :2]) / pixels - 0.5) * field * scale
        start = np.pad(place, ((0, 0), (0, 1)))
        rear = np.pad((drawn[:, 2:] * 2 - 1) * aperture[-1], ((0, 0), (0, 1)), constant_values=film)
        origin, way, alive = system.trace(start, rear - start)
        slope = film / np.linalg.norm(rear - start, axis=1) / way[:, 2]
        weight, colour, free = np.where(alive, slope**4, 0), np.zeros(count), np.ones(count, bool)
        for z, value, where in surfaces:
            at = origin[:, :2] + (pupil + z - origin[:, 2:]) * way[:, :2] / way[:, 2:]
            hit = free & where(at[:, 0], at[:, 1])
            colour[hit] = value(at[:, 0], at[:, 1])[hit, 0]
            free &= ~hit
        light.append((colour * weight).sum() / weight.sum())
        passed.append(weight.mean())
    return np.array(light), np.array(passed)


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("path", "f_number", "field", "pixels"),
    [(None, 3.0, 0.5, 64), (SINGLET, 2.6, 0.4, 96), (DGAUSS, 2.1, 0.6, 96), (WIDE, 2.8, 1.2, 96)],
)
def test_pictures_are_those_of_rays_through_the_surfaces(singlet, path, f_number, field, pixels):
    """A card before the plane in focus, half a wall in it, a wall behind: 45 dB, each colour."""
    lens, focus = Lens.read(path or singlet), 2.0
    focal = lens.focal_length_m
    camera = Camera(focal, field * image_distance(focal, focus), f_number, focus)
    near, far = 0.6 * focus, 3 * focus

    def waves(z):
        return grey(lambda x, y: 0.5 + 0.45 * np.sin(110 * x / z) * np.sin(110 * y / z + 0.5))

    surfaces = [
        (near, waves(near), lambda x, y: np.hypot(x - 0.2 * field * near, y) < 0.2 * field * near),
        (focus, waves(focus), lambda x, y: x < 0.15 * field * focus),
        (far, waves(far), everywhere),
    ]  # fmt: skip
    chosen = np.random.default_rng(0).integers(6, pixels - 6, (150, 2))
    plane = SensorPlane(focus, f_number, lens=lens)
    seen_by = [brute_force(each, plane, pixels, field, surfaces, chosen) for each in lens.colours]
    expected, etendue = seen_by[len(seen_by) // 2]
    expected = np.stack([light for light, _ in seen_by], 1)
    views = displaced_views(Slab(camera, 8, 2 * pixels))
    rays, (row, column) = seen(views, surfaces), chosen.T
    slicer = DepthSlicer(views, [plane, replace(plane, lens=None)], pixels)
    slicer.add(slice(0, 64), *rays)
    made, thin = slicer.pictures()[:, row, column]
    darkened = slicer._placed[0].illumination[row, column]
    colours, perfect = (made / darkened)[:, : len(seen_by)], thin[:, : len(seen_by)]
    assert all(psnr(*each, peak=1.0) > 45 for each in zip(colours.T, expected.T, strict=True))
    assert psnr(perfect, expected, peak=1.0) < 35
    shares = slicer._placed[0]._light[1][row, column] / etendue
    np.testing.assert_allclose(shares / np.median(shares), 1, atol=0.05)


def test_vignetting_closes_the_pupil_from_one_side():
    lens, views = alone(DGAUSS), displaced_views(Slab(Camera(0.05, 0.036, 2.1, 4.0), 8, 32))
    slicer = DepthSlicer(views, [SensorPlane(4.0, 2.1, lens=lens)], 32)
    white = np.ones((64, 32, 32, 3), np.float32)
    slicer.add(slice(0, 64), white, np.full((64, 32, 32), 4.0, np.float32))
    picture = slicer.pictures()[0, ..., 0]
    assert picture[16, 16] == pytest.approx(1, abs=0.01)
    assert picture[16, 2] < 0.75 and picture[3, 3] < picture[16, 2]
    np.testing.assert_allclose(picture, picture[::-1, ::-1], atol=0.01)


def test_each_colour_has_its_own_focus_and_place():
    """Blue is refracted more; a line off the axis has coloured edges, in the middle none."""
    lens = Lens.read(DGAUSS)
    places = [
        each.landing(np.array([[0.01, 0.0]]), np.zeros((1, 2)), 4.0, 0.05).displacement[0, 0]
        for each in lens.colours
    ]
    assert len(places) == 3 and abs(places[0] - places[2]) > 1e-5
    assert [each.colours for each in lens.colours] == [(each,) for each in lens.colours]
    assert len(Lens.read(WIDE).colours) == 1


@pytest.mark.kernels
@pytest.mark.parametrize(
    ("path", "field", "least_db", "effect_db"), [(SINGLET, 0.02, 60, 45), (DGAUSS, 0.036, 50, 60)]
)
def test_colours_share_boxes_where_they_are_together(path, field, least_db, effect_db):
    """As if each were sliced alone; a singlet's colours are apart, most of a double Gauss's not."""
    lens, camera = Lens.read(path), Camera(0.05, field, 2.8, 4.0)
    views, plane = displaced_views(Slab(camera, 8, 128)), SensorPlane(4.0, 2.8, lens=lens)
    waves = grey(lambda x, y: 0.5 + 0.4 * np.sin(x / field) * np.sin(y / field))
    rays = seen(views, [(3.0, waves, lambda x, y: x < 0), (9.0, waves, everywhere)])
    inner = np.s_[..., 6:-6, 6:-6, :]
    (made,) = sliced(views, [plane], 128, *rays)[inner]
    pictures = sliced(views, [replace(plane, lens=each) for each in lens.colours], 128, *rays)
    apart = np.stack([picture[..., c] for c, picture in enumerate(pictures[inner])])
    for colour in range(3):
        assert psnr(made[..., colour], apart[colour], peak=1.0) > least_db
    assert psnr(apart[1], apart[2], peak=1.0) < effect_db


@pytest.mark.kernels
def test_halves_of_the_pupil_make_the_whole(singlet):
    views = displaced_views(Slab(Camera(0.05, 0.03, 3.0, 4.0), 4, 48))
    plane = SensorPlane(4.0, 3.0, lens=alone(singlet))
    rays = seen(views, [(6.0, grey(lambda x, y: 0.5 + 0.4 * np.sin(9 * x)), everywhere)])
    whole, left, right = sliced(views, [plane, *plane.halves()], 24, *rays)[:, 4:-4, 4:-4]
    np.testing.assert_allclose((left + right) / 2, whole, atol=0.02)
    assert np.abs(left - right).max() > 0.02


@pytest.mark.kernels
@pytest.mark.parametrize("focus", [4.0, 12.0])
def test_mirrors_and_veils_are_what_they_show_through_the_same_lens(singlet, tmp_path, focus):
    """A mirror shows a wall where its image is; a veil half of itself and half of what is behind.
    Both have two parts, what is compared has one."""
    rng = np.random.default_rng(3)
    behind, veil, (mirror, _) = (wall(z, -6, 6, n, rng) for z, n in ((-4, 40), (4, 40), (4, 1)))
    image = behind[0] * np.float32([1, 1, -3]), behind[1]

    def scene(*shapes):
        return replace(made := make_scene(shapes), camera=replace(made.camera, sensor_width_m=0.12))

    mirrored = scene((mirror, np.ones_like(mirror), MIRROR), (*behind, {}))
    veiled = scene((*veil, {"opacity": 0.5}), (*image, {}))
    plane = SensorPlane(focus, 4.0, lens=singlet)

    def stored(of):
        return lfcore.record(of, tmp_path / "field.mkv", pixels=32).refocus_many([plane])

    for form, least_db in (
        (lambda of: lfcore.render(of, planes=[plane], pixels=32), 60), (stored, 48),
    ):  # fmt: skip
        of_image, of_veil = form(scene((*image, {}))), form(scene((*veil, {})))
        inner = np.s_[0, 3:-3, 3:-3]
        light = of_image * np.float32(MIRROR["diffuse"])
        assert psnr(form(mirrored)[inner], light[inner], peak=1.0) > least_db
        assert psnr(form(veiled)[inner], ((of_image + of_veil) / 2)[inner], peak=1.0) > least_db
    perfect = lfcore.render(mirrored, planes=[replace(plane, lens=None)], pixels=32)
    assert psnr(perfect[inner], light[inner], peak=1.0) < 35


def test_cells_beyond_the_aperture_have_finite_nodes():
    views = displaced_views(Slab(CAMERA, 4, 48))
    (placed,) = DepthSlicer(views, [SensorPlane(4.0, 2.8, lens=alone(DGAUSS))], 24)._placed
    assert (placed.cells.share == 0).any() and np.abs(placed.nodes).max() < 100


def test_rays_around_a_picture_are_traced_for_barrel_distortion():
    camera = Camera(0.022, 0.03, 2.8, 4.0)
    margin = lens_margin(
        [SensorPlane(4.0, 2.8, lens=alone(WIDE))], camera, lfcore.optics.size.Size(96, 64)
    )
    assert 1 <= margin <= 12
    assert lens_margin([SensorPlane(4.0, 2.8)], camera, lfcore.optics.size.Size(96, 64)) == 0


def test_rays_beside_an_asphere_miss_it():
    """They are vignetted; those that hit it are on it, to a picometre, and a cone is no sphere."""
    system = LensSystem(*map(np.array, ([0.02], [0.05], [1.5], [0.1])), conic=np.array([0.5]))
    assert system.reach(0) == pytest.approx(0.02 / np.sqrt(1.5))
    start = np.array([[0.0, 0, 0], [0.01, 0.005, 0], [0.03, 0, 0]])
    ((_, hit, _, passed),) = system.steps(start, np.array([[0.0, 0, 1]] * 3))
    assert passed.tolist() == [True, True, False]
    depth = system.sag(0, (hit[:2, :2] ** 2).sum(1))[0]
    np.testing.assert_allclose(hit[:2, 2], 0.05 - depth, atol=1e-12)
    assert np.isnan(system.sag(0, 0.03**2)[0])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("50 4 1.5\n", "four to"), ("glass\n", "row 0"),
        ("50 -1 1.5 9\n-50 1 1 9\n", "surface 1"), ("50 4 0.5 9\n-50 1 1 9\n", "index"),
        ("50 4 1.5 9 -3\n-50 1 1 9 0\n", "Abbe"), ("-50 4 1.5 9\n50 1 1 9\n", "real image"),
        ("50 4 1.5 40\n-50 2 1 40\n0 45 0 12\n", "overlap"),
    ],
)  # fmt: skip
def test_bad_files_are_refused(tmp_path, text, words):
    path = tmp_path / "bad.dat"
    path.write_text(text)
    refused(rf"bad\.dat.*{words}", Lens.read, path)


def test_planes_that_a_lens_cannot_form_are_refused(singlet):
    lens, slab = Lens.of(singlet), Slab(Camera(0.05, 0.03, 1.4, 4.0), 4, 16)
    assert Lens.of(singlet) is lens
    refused("singlet.*f_number.*wider", SensorPlane(4.0, 1.4, lens=lens).check, slab)
    refused("singlet.*focus_m.*cannot focus", SensorPlane(0.0501, 4.0, lens=lens).check, slab)
    refused("lens", SensorPlane, 4.0, 4.0, lens=3)
    scene = lfcore.load_scene("example")
    plane = scene.plane("near", lens=singlet)
    assert plane.f_number == max(lens.f_number, scene.camera.f_number)
    refused("nearest.*lens", lfcore.render, scene, planes=[plane], filter="nearest", pixels=8)
    refused("quality", lfcore.render, scene, planes=[plane], quality=lfcore.Quality(20), pixels=8)


@pytest.mark.slow
def test_zemax_text_is_the_same_lens(tmp_path):
    pytest.importorskip("optiland")
    text = "MODE SEQ\nENPD 10\nFTYP 0 0 1 1 0 0 0 1\nXFLN 0\nYFLN 0\nWAVM 1 0.5876 1\nPWAV 1\n"
    glass, air = "GLAS ___BLANK 1 0 1.5 60", ""
    for number, (radius, gap, material, half, stop) in enumerate([
        (np.inf, "INFINITY", air, 1, ""), (50, 6, glass, 15, ""), (-50, 3, air, 15, ""),
        (np.inf, 45, air, 10, "STOP"), (np.inf, 0, air, 1, ""),
    ]):  # fmt: skip
        text += f"SURF {number}\n  TYPE STANDARD\n  {stop}\n  CURV {1 / radius}\n  DISZ {gap}\n"
        text += f"  {material}\n  DIAM {half}\n"
    path, table = tmp_path / "lens.zmx", tmp_path / "lens.dat"
    path.write_text(text)
    table.write_text("50 6 1.5 30 60\n-50 3 1 30 0\n0 45 0 20 0\n")
    one, other = Lens.read(path), Lens.read(table)
    assert one.focal_length_m == pytest.approx(other.focal_length_m, rel=1e-4)
    assert one.f_number == pytest.approx(other.f_number, rel=1e-3) and one.stop == other.stop
    path.write_text(
        text.replace("TYPE STANDARD\n  \n  CURV 0.02", "TYPE EVENASPH\n  \n  CURV 0.02")
    )
    assert Lens.read(path).focal_length_m == pytest.approx(one.focal_length_m)
    path.write_text(path.read_text().replace("EVENASPH", "ODDASPHE"))
    refused(r"lens\.zmx.*SURF 1.*no sphere", Lens.read, path)
    path.write_text("hello")
    refused(r"lens\.zmx.*Zemax", Lens.read, path)


@pytest.mark.kernels
def test_the_command_takes_a_lens(tmp_path, singlet, capsys):
    scene, field = ["render", "example", "--pixels", "16"], tmp_path / "field.mkv"
    picture = tmp_path / "picture.npy"
    assert not main([*scene, "--lens", str(singlet), "-o", str(picture)])
    assert not main([*scene, "-o", str(tmp_path / "thin.npy")])
    assert np.abs(np.load(picture) - np.load(tmp_path / "thin.npy")).max() > 0.01
    assert not main(["record", "example", "--pixels", "16", "-o", str(field)])
    assert not main(["refocus", str(field), "--plane", f"lens={singlet}", "-o", str(picture)])
    assert not main(
        ["stack", str(field), "--focus", "near:far:2", "--lens", str(singlet), "-o", str(picture)]
    )
    assert np.load(picture).shape == (2, 16, 16, 3)
    capsys.readouterr()
    assert main(
        ["refocus", str(field), "--lens", str(singlet), "--filter", "nearest", "-o", str(picture)]
    )
    assert "has no lenses from files" in capsys.readouterr().err
