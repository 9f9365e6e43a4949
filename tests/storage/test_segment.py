"""Segments and the stream of inverse depths: what comes back, and clean failures."""

from dataclasses import replace

import av
import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_scenes import refused
from stored_fields import segment_frames
from test_damage import remux, signed
from test_light_field import PRESETS, read

from lfcore import Camera, Encoding, Metadata, Slab, StorageError
from lfcore.colour import to_uint8
from lfcore.evaluation.metrics import psnr
from lfcore.storage.codecs import CODECS, SMALLEST_FRAME
from lfcore.storage.container import DepthSegments, join_segments
from lfcore.storage.depth_stream import DepthCodes, sweep_step
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.pixels import pixel_format
from lfcore.storage.segment import SegmentWriter, open_video, read_segment
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames

PLAIN = Encoding(pixel_format="yuv420p", crf=22, preset="veryfast")
ALL = [(codec, name) for codec, names in CODECS.items() for name in names]


def spec_of(codec: str, name: str, **settings) -> Encoding:
    return Encoding(codec, name, preset=PRESETS[codec], **{"crf": 8, **settings})


def clip(width: int, height: int, count: int) -> np.ndarray:
    """(F, height, width, 3) float32: a smooth picture that moves."""
    f, y, x = np.mgrid[0:count, 0:height, 0:width].astype(np.float32)
    waves = [np.sin((x + f) / 9 + c) * np.cos((y + f / 2) / 11 + 2 * c) for c in range(3)]
    return (0.5 + 0.4 * np.stack(waves, -1)).astype(np.float32)


def encode(path, spec, rgb) -> np.ndarray:
    height, width = rgb.shape[1:3]
    frames = frames_from_rgb(rgb, spec.pixel_format)
    with SegmentWriter(path, spec, width, height) as writer:
        writer.write(frames[: len(frames) // 2])
        writer.write(frames[len(frames) // 2 :])
    return frames


@pytest.mark.parametrize("codec, name, width, height", [
    *((*pair, *size) for pair in ALL for size in ((16, 16), (66, 34))),
    ("libx264", "yuv444p", 33, 17), ("ffv1", "gbrp", 33, 17), ("ffv1", "yuv444p10le", 33, 17),
])  # fmt: skip
def test_round_trip(tmp_path, codec, name, width, height):
    spec = spec_of(codec, name)
    least = SMALLEST_FRAME.get(codec, 0)
    width, height = max(width, least), max(height, least)
    frames = encode(tmp_path / "s.mp4", spec, clip(width, height, 9))
    about, _ = read_segment(tmp_path / "s.mp4")
    assert (about.width, about.height, about.pixel_format) == (width, height, name)
    back = segment_frames(tmp_path / "s.mp4")
    assert back.shape == frames.shape
    if spec.lossless:
        assert (back == frames).all()
    else:
        form = pixel_format(name)
        planes = (form.views(each, width, height) for each in (back, frames))
        for a, b in zip(*planes, strict=True):
            assert psnr(a, b, peak=2**form.bits) > 38


@pytest.mark.parametrize("codec, size, frames", [
    *((codec, (48, 32), 12) for codec in CODECS if codec not in SMALLEST_FRAME),
    ("libx264", (64, 64), 12), ("libx264", (144, 128), 12),
    ("libx265", (66, 66), 12), ("libx265", (144, 128), 12),
    *(("libx265", (96, 96), few) for few in (1, 2, 3)),
])  # fmt: skip
def test_the_same_input_gives_the_same_file(tmp_path, codec, size, frames):
    spec, files = spec_of(codec, "yuv420p"), set()
    for _ in range(12 if codec in ("libx264", "libx265") else 2):
        encode(tmp_path / "s.mp4", spec, clip(*size, frames))
        files.add((tmp_path / "s.mp4").read_bytes())
    assert len(files) == 1 and len(segment_frames(tmp_path / "s.mp4")) == frames


@pytest.mark.parametrize("codec, name", [pair for pair in ALL if pair[1] != "gbrp"])
def test_streams_are_tagged(tmp_path, codec, name):
    encode(tmp_path / "s.mp4", spec_of(codec, name), clip(72, 72, 3))
    with av.open(str(tmp_path / "s.mp4")) as container:
        frame = next(container.decode(video=0))
        # H.273: primaries BT.709 1, transfer sRGB 13, matrix BT.709 1; limited range 1
        tags = (frame.color_primaries, frame.color_trc, frame.colorspace, frame.color_range)
        assert tags == (1, 13, 1, 1)


@pytest.mark.parametrize("codec, name", [(c, n) for c, n in ALL if n.startswith(("yuv444", "gb"))])
def test_other_programs_see_the_same_picture(tmp_path, codec, name):
    """PyAV's default conversion and OpenCV agree with ours within one code for 4:4:4 and RGB."""
    path = tmp_path / "s.mp4"
    encode(path, spec_of(codec, name), clip(96, 72, 4))
    ours = to_uint8(rgb_from_frames(segment_frames(path), name, 96, 72)).astype(int)
    with av.open(str(path)) as container:
        theirs = np.stack([frame.to_rgb().to_ndarray() for frame in container.decode(video=0)])
    assert np.abs(ours - theirs).max() <= 1
    capture = cv2.VideoCapture(str(path), cv2.CAP_FFMPEG)
    seen = np.stack([capture.read()[1][..., ::-1] for _ in range(4)])
    assert np.abs(ours - seen).max() <= 1


def test_subsampled_colour_agrees_with_accurate_conversion(tmp_path):
    """4:2:0 is filtered differently by each program, and FFmpeg's default is a coarse one."""
    path = tmp_path / "s.mp4"
    encode(path, spec_of("libx264", "yuv420p"), clip(48, 32, 3))
    ours = rgb_from_frames(segment_frames(path), "yuv420p", 48, 32) * 255
    # BICUBIC, FULL_CHR_H_INT, FULL_CHR_H_INP and ACCURATE_RND of libswscale
    flags = 4 | 0x2000 | 0x4000 | 0x40000
    with av.open(str(path)) as container:
        frames = [frame.to_rgb(interpolation=flags) for frame in container.decode(video=0)]
    assert psnr(np.stack([frame.to_ndarray() for frame in frames]), ours, peak=255) > 36


@pytest.mark.parametrize("settings, words", [
    ({"codec": "vp9"}, "unknown codec"),
    ({"pixel_format": "gbrp"}, "does not take"),
    ({"pixel_format": "nv12"}, "unknown pixel format"),
    ({"crf": -1}, "crf"), ({"gop": -2}, "gop"), ({"threads": 0}, "threads"),
    ({"preset": 1.5}, "preset"),
    ({"refs": 99}, "refs"), ({"bframes": 40}, "bframes"),
])  # fmt: skip
def test_impossible_settings_are_refused(settings, words):
    refused(words, Encoding, **settings)


@pytest.mark.parametrize("size", [(63, 64), (128, 32)])
def test_frames_too_small_to_be_reproducible_are_refused(tmp_path, size):
    with pytest.raises(StorageError, match=r"codec: libx265 is not reproducible.*Pack more"):
        SegmentWriter(tmp_path / "s.mp4", spec_of("libx265", "yuv420p"), *size)
    for codec in set(CODECS) - {"libx265"}:
        SegmentWriter(tmp_path / "s.mp4", spec_of(codec, "yuv420p"), *size)


def test_failures_leave_no_file(tmp_path):
    path = tmp_path / "s.mp4"
    for spec, size, words in (
        (replace(PLAIN, preset="warp"), 1536, "libx264"), (PLAIN, 1535, "frames must be"),
    ):  # fmt: skip
        with pytest.raises(StorageError, match=words), SegmentWriter(path, spec, 32, 32) as writer:
            writer.write(np.zeros((1, size), np.uint8))
    for wrong, words in ((path, "no frames"), (tmp_path / "missing" / "s.mp4", "missing")):
        with pytest.raises(StorageError, match=words), SegmentWriter(wrong, PLAIN, 32, 32):
            pass
    with pytest.raises(ZeroDivisionError), SegmentWriter(path, PLAIN, 32, 32) as writer:
        writer.write(np.zeros((1, 1536), np.uint8))
        raise ZeroDivisionError
    assert not writer._output.streams  # the container is closed
    assert list(tmp_path.iterdir()) == []


def test_a_format_that_shows_its_streams_late_is_refused_in_one_line(tmp_path):
    with av.open(str(path := tmp_path / "s.mpg"), "w", format="mpeg") as container:
        stream = container.add_stream("mpeg2video", rate=25, width=32, height=32)
        container.mux(stream.encode(av.VideoFrame(32, 32, "yuv420p")) + stream.encode())
    with pytest.raises(StorageError, match="opened as a video"):
        open_video(path)


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
    plain = LightFieldFile.open(light.path).views(0, 0, 3, 3, codes=True)
    np.testing.assert_array_equal(field.views(0, 0, 3, 3, codes=True), plain)


def test_the_small_reader_and_any_player_see_the_colours_first(made):
    about, rays = read(made[0])
    expected = LightFieldFile.open(made[0]).views(0, 0, 3, 3, codes=True)
    assert np.abs(np.rint(255 * rays) - expected).max() <= 1
    # The depths, as the document describes them.
    far, near = about["depth"]["dioptres"]
    with av.open(str(made[0])) as file:
        first = next(file.decode(video=1))
        for stream in range(2):  # frame k of both is shown at 40 k ms
            file.seek(0)
            times = sorted(p.pts for p in file.demux(video=stream) if p.size)
            assert times == [40 * k for k in range(9)]
    codes = np.frombuffer(first.planes[0], np.uint8).reshape(32, -1)[:, :32]
    np.testing.assert_array_equal(codes, made[1][0])
    assert (far, near) == (CODES.far, CODES.near)


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
    refused("2 of 3 segments can still be read, not 1", field.verify)
    salvaged = LightFieldFile.open(path, salvage=True)
    assert [part.index for part in salvaged.segments] == [0, 2]


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("dioptres", [0.5, 0.5], "no range"),
        ("dioptres", [-0.1, 0.5], "no range"),
        ("dioptres", [0, float("inf")], "no range"),
        ("dioptres", [1], "metadata"),
        ("pixel_format", "yuv420p", "unknown depth.pixel_format"),
        ("pixel_format", [], "unknown depth.pixel_format"),
        ("lattice", "square", "unknown depth.lattice"),
        ("lattice", {}, "unknown depth.lattice"),
        ("pixels", 0, "pixels: cannot be 0"),
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
    refused("contradicts itself", LightFieldFile.open, path)
