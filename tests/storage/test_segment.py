"""Segments: what is written comes back, other programs see the same picture, failures are clean."""

from dataclasses import replace

import av
import cv2
import numpy as np
import pytest
from stored_fields import segment_frames

from lfcore.colour import to_uint8
from lfcore.errors import StorageError
from lfcore.evaluation.metrics import psnr
from lfcore.storage.codecs import CODECS, SMALLEST_FRAME, Encoding
from lfcore.storage.pixels import pixel_format
from lfcore.storage.segment import SegmentWriter, read_segment
from lfcore.storage.ycbcr import frames_from_rgb, rgb_from_frames

PRESETS = {"libx264": "veryfast", "libx265": "superfast", "libsvtav1": 12, "ffv1": None}
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


ODD = [
    (*pair, 33, 17) for pair in (("libx264", "yuv444p"), ("ffv1", "gbrp"), ("ffv1", "yuv444p10le"))
]


@pytest.mark.parametrize(
    "codec, name, width, height",
    [(*pair, *size) for pair in ALL for size in ((16, 16), (66, 34))] + ODD,
)
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
        for a, b in zip(
            form.views(back, width, height), form.views(frames, width, height), strict=True
        ):
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
    ({"refs": 99}, "refs"), ({"bframes": 40}, "bframes"), ({"lookahead": -1}, "lookahead"),
])  # fmt: skip
def test_impossible_settings_are_refused(settings, words):
    with pytest.raises(StorageError, match=words):
        Encoding(**settings)


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
    for wrong, words in ((path, "without frames"), (tmp_path / "missing" / "s.mp4", "missing")):
        with pytest.raises(StorageError, match=words), SegmentWriter(wrong, PLAIN, 32, 32):
            pass
    with pytest.raises(ZeroDivisionError), SegmentWriter(path, PLAIN, 32, 32) as writer:
        writer.write(np.zeros((1, 1536), np.uint8))
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []
