"""Films of light fields: each instant is the light field of the scene there and then."""

import pickle
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from mirror_room import mirror_room
from moving_scene import moving_squares
from plain_scenes import refused

import lfcore
from lfcore.cli import main
from lfcore.colour import srgb_encode
from lfcore.lightfield import LightField
from lfcore.rendering import record_film

PIXELS, TIMES = 12, [0.0, 0.25, 0.5, 0.75, 1.0, 1.25]
DGAUSS = Path(__file__).parents[2] / "scenes" / "lenses" / "dgauss.dat"
EXACT = lfcore.Encoding("ffv1")


@pytest.fixture(scope="module")
def scene():
    return moving_squares()


@pytest.fixture(scope="module")
def film(scene, tmp_path_factory):
    path = tmp_path_factory.mktemp("film") / "film.mkv"
    return lfcore.record(scene, path, times=TIMES, pixels=PIXELS, views=4, encoding=EXACT)


def test_each_instant_is_the_light_field_of_its_time(scene, film, tmp_path):
    assert film.times == tuple(TIMES) and film.instant == 0 and film.metadata.film is None
    for number in (5, 0, 3, -2):
        alone = lfcore.record(
            scene.at(TIMES[number]), tmp_path / "one.mkv", pixels=PIXELS, views=4, encoding=EXACT
        )
        now = film.at(number)
        np.testing.assert_array_equal(now.views(0, 0, 4, 4), alone.views(0, 0, 4, 4))
        # Depths have the codes of all instants.
        np.testing.assert_allclose(now.depth(), alone.depth(), rtol=0.02)
        assert now.content == alone.content and alone.times == (0.0,)
        picture = now.refocus(focus_m=2.0)
        np.testing.assert_allclose(picture, alone.refocus(focus_m=2.0), atol=0.02)
        np.testing.assert_array_equal(pickle.loads(pickle.dumps(now)).refocus(focus_m=2.0), picture)
    assert np.abs(film.at(0).view(0, 0) - film.at(3).view(0, 0)).max() > 0.1
    refused("no instant 6; it has 0 to 5", film.at, 6)
    assert repr(film.at(2)).endswith("with depth, instant 2 of 6>")


def test_a_group_is_decoded_once(film):
    again = LightField.open(film.path)
    for number in range(6):
        again.at(number).refocus(focus_m=2.0)
    assert again._videos[0].decoded_frames == 6 * 16
    film.verify()


@pytest.mark.slow
def test_a_killed_record_continues_after_the_finished_groups(scene, film, tmp_path, monkeypatch):
    path, traced, how = tmp_path / "film.mkv", [], {"pixels": PIXELS, "views": 4, "encoding": EXACT}
    encode = record_film.encode

    def stop(frames, *rest):
        traced.append(rest[1][0][0].name)
        if len(traced) == 2:
            raise KeyboardInterrupt
        encode(frames, *rest)

    monkeypatch.setattr(record_film, "encode", stop)
    with pytest.raises(KeyboardInterrupt):
        lfcore.record(scene, path, times=TIMES, **how)
    assert not path.exists() and len(list(path.with_name("film.mkv.parts").iterdir())) == 2
    whole = lfcore.record(scene, path, times=TIMES, **how)
    assert len(traced) == 3 and traced[2] == traced[1]
    assert path.read_bytes() == film.path.read_bytes() and whole.times == film.times
    assert list(tmp_path.iterdir()) == [path]


def test_a_damaged_film_has_its_whole_instants(film, tmp_path):
    path, data = tmp_path / "cut.mkv", bytearray(film.path.read_bytes())
    last = film.whole.segments[-1]
    whole = film.at(1).view(1, 1)
    for damaged in (data[: -last.bytes // 2], data):
        if damaged is data:
            damaged[-last.bytes - 2000] ^= 255
        path.write_bytes(damaged)
        with pytest.raises(lfcore.StorageError, match="segments can still be read") as caught:
            LightField.open(path).verify()
        assert "\n" not in str(caught.value)
        left = LightField.open(path, salvage=True)
        assert [bool(left.at(k).damage) for k in range(6)] == [False] * 4 + [True] * 2
        np.testing.assert_array_equal(left.at(1).view(1, 1), whole)


def test_metadata_that_contradict_themselves_are_refused(film):
    whole = film.whole
    for change, words in (
        ({"times": (0.0, 0.0, *TIMES[2:])}, "ascending"), ({"group": 0}, "film.group"),
        ({"group": 5}, "do not fit"), ({"content": ()}, "one for each time"),
    ):  # fmt: skip

        def changed(change=change):
            replace(whole, film=replace(whole.film, **change)).check()

        refused(words, changed)


def test_the_rays_of_a_film_can_be_chosen_by_quality(scene, tmp_path):
    film = lfcore.record(
        scene, tmp_path / "film.mkv", times=[0.0, 0.5], pixels=24, quality=lfcore.Quality(30)
    )
    assert film.content["expected"]["db"] >= 29
    for now in (film.at(0), film.at(1)):
        alone = lfcore.render(scene.at(now.instant / 2), views=8, pixels=24, focus_m=2.5)
        error = np.square(srgb_encode(now.refocus(focus_m=2.5)) - srgb_encode(alone)).mean()
        assert -10 * np.log10(error) > 30


def test_what_a_film_does_not_have(scene, tmp_path):
    path = tmp_path / "no.mkv"
    for how, words in (
        ({"times": []}, "ascending"), ({"times": [1, 0.5]}, "ascending"),
        ({"times": TIMES, "quality": lfcore.Quality(30), "views": 4}, "Leave out views"),
        ({"times": TIMES, "encoding": lfcore.Encoding(depth=False)}, "has depth"),
    ):  # fmt: skip
        refused(words, lfcore.record, scene, path, pixels=PIXELS, **how)


def test_a_focus_is_pulled_evenly_in_dioptres(film):
    near, far = film.plane(2.0, 2.0), film.plane(4.0, 4.0)
    pictures = list(film.pull([(0.25, near), (1.25, far)]))
    assert len(pictures) == 6
    for number, (focus, f_number) in {0: (2, 2), 1: (2, 2), 3: (8 / 3, 8 / 3), 5: (4, 4)}.items():
        expected = film.at(number).refocus(focus_m=focus, f_number=f_number)
        np.testing.assert_allclose(pictures[number], expected, atol=1e-6)
    lens = [film.plane(each, 4.0, lens=DGAUSS) for each in (2.0, 4.0)]
    for number, picture in enumerate(film.pull([(0.25, lens[0]), (1.25, lens[1])])):
        if number == 3:
            expected = film.at(3).refocus_many([replace(lens[0], focus_m=8 / 3)])[0]
            np.testing.assert_array_equal(picture, expected)
            perfect = film.at(3).refocus(focus_m=8 / 3, f_number=4.0)
            assert np.abs(picture - perfect).max() > 0.01
    reach = film.require_slab().lens_positions()[-1]
    pictures = list(film.pull([(0.0, (-reach, 0)), (1.0, (reach, 0))]))
    np.testing.assert_array_equal(pictures[2], film.at(2).views_at([[0, 0]])[0])
    np.testing.assert_array_equal(pictures[5], film.at(5).views_at([[reach, 0]])[0])
    for keys, words in (
        ([], "ascending"), ([(1, near), (0, far)], "ascending"), ([(0, near), (1, (0, 0))], "one"),
        ([(0, near), (1, lens[1])], "differ in lens"),
        ([(0, near), (1, replace(far, aperture="square"))], "differ in aperture"),
    ):  # fmt: skip
        with pytest.raises(lfcore.OpticsError, match=words):
            next(film.pull(keys))
    with pytest.raises(lfcore.OpticsError, match="everything is in focus"):
        next(film.pull([(0.0, (0, 0))], filter="nearest"))


@pytest.fixture
def run(capsys):
    """A function that runs a command, and gives what it says."""

    def made(*words, code=0):
        assert main([str(word) for word in words]) == code
        return capsys.readouterr().err

    return made


@pytest.mark.slow
def test_the_command_writes_pulled_films_and_instants(film, tmp_path, run):
    table = tmp_path / "keys.csv"
    table.write_text("time,focus,f_number\n0,near,2\n1,far,4\n")
    for how in (["--focus", "2:4"], ["--keys", table], ["--focus", "3"]):
        run("refocus", film.path, "-o", tmp_path / "pulled.mp4", *how)
        with av.open(tmp_path / "pulled.mp4") as file:
            video = file.streams.video[0]
            assert (video.frames, video.average_rate) == (6, 4)
    run("refocus", film.path, "-o", tmp_path / "a.npy", "--instant", 3, "--focus", 2)
    np.testing.assert_array_equal(np.load(tmp_path / "a.npy"), film.at(3).refocus(focus_m=2.0))
    said = run("refocus", film.path, "-o", tmp_path / "a.npy", "--focus", 2)
    assert "the first of 6 instants; --instant has others" in said
    run("export", film.path, "-o", tmp_path / "all", "--format", "hci", "--views", "2x2")
    assert sorted(p.name for p in (tmp_path / "all").iterdir()) == [f"{k:04d}" for k in range(6)]
    table.write_text("time,view\n0,1 0\nsoon,0 0\n")
    for how, words in (
        (["a.png", "--focus", "2:4"], "Write an .mp4"), (["a.mp4", "--keys", table], "key 2"),
        (["a.mp4", "--instant", "2"], "--instant"),
    ):  # fmt: skip
        assert words in run("refocus", film.path, "-o", tmp_path / how[0], *how[1:], code=1)


def test_all_instants_are_exported_or_none(film, tmp_path, run, monkeypatch):
    export, count, out = lfcore.export_lightfield, [], tmp_path / "all"

    def full(field, format, folder, **more):
        assert not out.exists()
        count.append(folder)
        if len(count) == 3:
            raise lfcore.StorageError("the disk is full", file=folder / "a.png")
        return export(field, format, folder, **more)

    monkeypatch.setattr(lfcore, "export_lightfield", full)
    words = ["export", film.path, "-o", out, "--format", "json", "--views", "2x2"]
    assert f"{out}: the disk is full" in run(*words, code=1)
    assert not any(tmp_path.iterdir())
    run(*words)
    assert [p.name for p in tmp_path.iterdir()] == ["all"] and len(list(out.iterdir())) == 6
    assert "exists already" in run(*words, code=1)


@pytest.mark.slow
def test_the_command_records_frames_and_shows_instants(tmp_path, write_scene, tetrahedron, run):
    entry = {"file": tetrahedron.name, "motion": [{"translate_m": [0.5, 0, 0]}]}
    scene, small = write_scene({"objects": [entry]}), ["--pixels", "16"]
    path = tmp_path / "film.mkv"
    said = run("record", scene, "-o", path, *small, "--frames", "0:3", "--fps", 2)
    assert "it moves from 0 to 1 s" in said and "--time has others" in said
    film, loaded = LightField.open(path), lfcore.load_scene(scene)
    assert film.times == (0, 0.5, 1)
    for how, expected in (
        (["--time", 0.5], loaded.at(0.5)), (["--shutter", "0.1:0.4"], loaded.exposed(0.1, 0.4)),
        (["--time", 0.5, "--shutter", "0:0.2"], loaded.exposed(0.5, 0.7)), ([], loaded.at(0)),
    ):  # fmt: skip
        run("render", scene, "-o", tmp_path / "a.npy", *small, *how)
        np.testing.assert_array_equal(
            np.load(tmp_path / "a.npy"), lfcore.render(expected, pixels=16)
        )
    run("record", scene, "-o", path, *small, "--frames", "0:2", "--fps", 2, "--shutter", "0.1:0.2")
    assert LightField.open(path).content["shutter_s"] == [0.1, 0.2]
    still = write_scene({"objects": [{"file": tetrahedron.name}]})
    for how in (["--frames", "0:2"], ["--time", 1], ["--shutter", "0:1"]):
        words = run("record", still, "-o", tmp_path / "b.mkv", *small, *how, code=1)
        assert f"{how[0]}: the scene does not move" in words
    assert "--frames: is missing" in run("record", scene, "-o", path, "--fps", 2, code=1)


@pytest.mark.kernels
def test_a_film_keeps_specular_light_apart(tmp_path):
    """A mirror and a coat, and a wall behind the camera that moves."""
    scene = mirror_room()
    how = {"pixels": PIXELS, "encoding": EXACT}
    film = lfcore.record(scene, tmp_path / "film.mkv", times=[0.0, 0.3, 0.6, 0.8, 1.0], **how)
    assert film.metadata.specular and len(film.whole.streams) == 4
    film.verify()
    for number in (4, 1):
        now = film.at(number)
        alone = lfcore.record(scene.at(film.times[number]), tmp_path / "one.mkv", **how)
        np.testing.assert_array_equal(now.views(0, 0, 4, 4), alone.views(0, 0, 4, 4))
        np.testing.assert_allclose(now.refocus(focus_m=8), alone.refocus(focus_m=8), atol=0.03)
    assert np.abs(film.at(1).view(0, 0) - film.at(4).view(0, 0)).max() > 0.1
