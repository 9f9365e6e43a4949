"""The stream of inverse depths: its codes, its damage, and metadata that make no sense of it."""

from dataclasses import replace

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stored_fields import segment_frames
from test_damage import remux, signed
from test_light_field import read

from lfcore import Camera, Encoding, FrameLayout, Metadata, Slab, StorageError
from lfcore.storage.container import DepthSegments, join_segments
from lfcore.storage.depth_stream import DepthCodes, sweep_step
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.segment import SegmentWriter, read_segment

SLAB = Slab(Camera(0.05, 0.036, 2.0, 3.0), 3, 32)
CODES = DepthCodes(0.0, 0.5)


@pytest.fixture(scope="module")
def made(tmp_path_factory, make_store):
    """(file, codes) with three segments of views and their depths, H.264."""
    folder = tmp_path_factory.mktemp("depths")
    layout = FrameLayout("views", 3, 32, pixel_format="yuv444p")
    light = make_store(folder, layout, Encoding(pixel_format="yuv444p", crf=20))
    spec, rng, files = CODES.spec(SLAB), np.random.default_rng(1), []
    codes = rng.integers(0, 256, (9, 32, 32), np.uint8)
    for tile in light.tiles:
        files.append(folder / f"{tile.index}.depth.mp4")
        with SegmentWriter(files[-1], replace(spec, crf=0.0), 32, 32) as writer:
            for i, j in tile.elements():
                writer.write(codes[3 * j + i].reshape(1, -1))
    path = folder / "depth.mkv"
    join_segments(
        path, light.segments, light.tiles, layout, geometry=SLAB, spec=spec,
        scene={"name": "waves", "digest": "0123"},
        depth=DepthSegments(files, CODES, False, 16, spec),
    )  # fmt: skip
    return path, codes, light


@given(st.floats(0, 2), st.floats(1e-3, 20), st.integers(1, 64))
def test_codes_are_as_fine_as_a_quarter_of_a_pixel_of_sweep(far, reach, views):
    slab = Slab(SLAB.camera, views, 32)
    codes = DepthCodes.of_range(slab, far, far + reach)
    inverse = np.linspace(far, far + reach, 97)
    with np.errstate(divide="ignore", over="ignore"):
        found = 1 / codes.depth(codes.of_depth(1 / inverse)).astype(float)
    worst = np.abs(found - inverse).max()
    steps = (codes.near - codes.far) / sweep_step(slab)
    assert worst <= (codes.near - codes.far) / codes.last / 2 + 1e-6 * codes.near
    assert codes.pixel_format == ("gray" if steps <= 255 else "gray10le")
    if steps <= 1023:
        assert worst <= sweep_step(slab) * 0.5001 + 1e-6 * codes.near


def test_a_miss_is_the_far_end():
    assert CODES.depth(CODES.of_depth(np.float32([np.inf, 2.0]))).tolist() == [np.inf, 2.0]
    assert CODES.depth(CODES.of_depth(np.float32([0.1]))).tolist() == [2.0]


@pytest.mark.parametrize("name", ["gray", "gray10le"])
@pytest.mark.parametrize("spec", [Encoding(crf=0.0), Encoding("ffv1", preset=None, tune=None)])
def test_grey_frames_of_any_size_come_back(tmp_path, name, spec):
    form = DepthCodes(0.0, 1.0, name).format
    codes = np.random.default_rng(2).integers(0, 1 << form.bits, (3, 17, 33)).astype(form.dtype)
    path = tmp_path / "a.mp4"
    with SegmentWriter(path, replace(spec, pixel_format=name), 33, 17) as writer:
        writer.write(codes.reshape(3, -1).view(np.uint8))
    assert read_segment(path, grey=True)[0].pixel_format == name
    read = segment_frames(path, grey=True).view(form.dtype).reshape(codes.shape)
    # CRF 0 is lossless for 8 bits; for 10 it is quantiser 12, whose step is 2.5 codes.
    off = np.abs(read.astype(int) - codes)
    assert off.max() == 0 if spec.lossless or form.bits == 8 else off.mean() < 2.5


def test_both_streams_are_read_and_checked(made):
    path, codes, light = made
    field = LightFieldFile.open(path)
    field.verify()
    video = field.require_depth_video()
    frames = np.concatenate([f for part in video.segments for f in video.frames(part.index)])
    order = np.concatenate([tile.elements() for tile in light.tiles])
    expected = codes[3 * order[:, 1] + order[:, 0]].reshape(9, -1)
    np.testing.assert_array_equal(frames, expected)
    assert video.segments[1].first == field.segments[1].first
    plain = LightFieldFile.open(light.path)
    np.testing.assert_array_equal(
        field.views(0, 0, 3, 3, codes=True), plain.views(0, 0, 3, 3, codes=True)
    )


def test_the_small_reader_and_any_player_see_the_colours_first(made):
    about, rays = read(made[0])
    expected = LightFieldFile.open(made[0]).views(0, 0, 3, 3, codes=True)
    assert np.abs(np.rint(255 * rays) - expected).max() <= 1
    # The depths, as the document describes them.
    far, near = about["depth"]["dioptres"]
    with av.open(str(made[0])) as file:
        first = next(file.decode(video=1))
        assert first.pts == 0
    codes = np.frombuffer(first.planes[0], np.uint8).reshape(32, -1)[:, :32]
    np.testing.assert_array_equal(codes, made[1][0])
    assert (far, near) == (CODES.far, CODES.near)


def test_frame_k_of_both_is_shown_at_40_k_ms(made):
    with av.open(str(made[0])) as file:
        for stream in range(2):
            times = sorted(p.pts for p in file.demux(video=stream) if p.size)
            assert times == [40 * k for k in range(9)]
            file.seek(0)


def test_a_damaged_depth_is_refused_in_one_line(made, tmp_path):
    path, data = tmp_path / "bad.mkv", bytearray(made[0].read_bytes())
    with av.open(str(made[0])) as file:
        packets = [p for p in file.demux(video=1) if p.size]
    place = bytes(data).index(bytes(packets[4]))
    data[place + len(bytes(packets[4])) // 2] ^= 1
    path.write_bytes(data)
    field = LightFieldFile.open(path)
    field.views(0, 0, 3, 3, codes=True)  # the colours are whole
    with pytest.raises(StorageError, match=r"bad.mkv: segment 1 of the depths .*check sum") as all:
        list(field.require_depth_video().frames(1))
    assert "\n" not in str(all.value)
    with pytest.raises(StorageError, match="2 of 3 segments can still be read, not 1"):
        field.verify()
    salvaged = LightFieldFile.open(path, salvage=True)
    assert [part.index for part in salvaged.segments] == [0, 2]


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("dioptres", [0.5, 0.5], "no range"),
        ("dioptres", [-0.1, 0.5], "no range"),
        ("dioptres", [0, float("inf")], "no range"),
        ("dioptres", [1], "make no sense"),
        ("pixel_format", "yuv420p", "unknown depth.pixel_format"),
        ("pixel_format", [], "unknown depth.pixel_format"),
        ("lattice", "square", "unknown depth.lattice"),
        ("lattice", {}, "unknown depth.lattice"),
        ("pixels", 0, "pictures of 0"),
        ("segments", [[1, 2]], "a segment for each"),
        ("segments", [[1, -2]] * 3, "whole numbers"),
        ("settings", 3, "cannot be"),
        ("more", 3, "exactly the keys"),
    ],
)
def test_depths_that_make_no_sense_are_refused(made, key, value, said):
    text = LightFieldFile.open(made[0]).metadata.to_text()
    with pytest.raises(StorageError, match=said):
        Metadata.from_text(signed(text, lambda data: data["depth"].update({key: value})), made[0])


def test_metadata_and_streams_must_agree(made, tmp_path):
    """Without its second stream the file contradicts itself."""
    path = tmp_path / "one.mkv"
    remux(made[2].path, path, text=LightFieldFile.open(made[0]).metadata.to_text())
    with pytest.raises(StorageError, match="contradicts itself"):
        LightFieldFile.open(path)
