"""The joined file: bit-exact, self-contained, any part like the whole; what defaults keep."""

import runpy
import zlib
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from plain_scenes import refused
from stored_fields import segment_frames

from lfcore import Encoding, LightField, StorageError
from lfcore.colour import display_values
from lfcore.storage.codecs import SMALLEST_FRAME
from lfcore.storage.container import join_segments, pack_segments, unpacked
from lfcore.storage.defaults import chosen_encoding, default_kind, default_pack, macropixel_pack
from lfcore.storage.layout import FrameLayout
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.segment import SegmentWriter, open_video

SCENE = {"name": "waves", "digest": "0123"}
PRESETS = {"libx264": "veryfast", "libx265": "superfast", "libsvtav1": "12", "ffv1": None}


def truth(field: np.ndarray) -> np.ndarray:
    """The field as rectangle() gives it: [v, u, j, i]."""
    return field.transpose(2, 3, 0, 1, 4)


def everything(light_field: LightFieldFile) -> np.ndarray:
    size = light_field.layout.pixels
    return light_field.rectangle(0, 0, size, size, codes=True)


def macropixels(codec: str, views: int, pixels: int, name: str = "yuv420p") -> FrameLayout:
    """A macropixel a frame; for an encoder that wants larger frames, 4 x 4 larger ones."""
    if codec in SMALLEST_FRAME:
        return FrameLayout("macropixels", 20, pixels, pack=4, pixel_format=name)
    return FrameLayout("macropixels", views, pixels, pixel_format=name)


@pytest.mark.parametrize("codec, name", [
    ("libx264", "yuv420p"), ("libx264", "yuv444p10le"), ("libx265", "yuv444p"),
    ("libsvtav1", "yuv420p"), ("ffv1", "gbrp"), ("ffv1", "yuv420p"),
])  # fmt: skip
def test_joining_is_bit_exact(tmp_path, make_store, codec, name):
    spec = Encoding(codec, name, crf=10, preset=PRESETS[codec])
    stored = make_store(tmp_path, macropixels(codec, 4, 9, name), spec)
    light_field = LightFieldFile.open(stored.path)
    light_field.verify()
    assert light_field.slab == stored.slab and light_field.layout == stored.layout
    assert light_field.metadata.settings == spec.to_json()
    assert [part.tile for part in light_field.segments] == stored.tiles and len(stored.tiles) >= 3
    made = zip(light_field.segments, stored.segments, stored.frames, strict=True)
    for part, path, frames in made:
        joined = np.concatenate(list(light_field.video.frames(part.index, chunk=5)))
        assert (joined == segment_frames(path)).all()
        assert codec != "ffv1" or (joined == frames).all()
        with open_video(path) as file:
            packets = b"".join(bytes(packet) for packet in file.demux(video=0))
        assert (part.bytes, part.crc32) == (len(packets), zlib.crc32(packets))


@given(start=st.integers(0, 36), length=st.integers(0, 36), chunk=st.integers(1, 9))
@settings(max_examples=25)
def test_any_start_equals_sequential(stored, start, length, chunk):
    stop = min(36, start + length)
    light_field = LightFieldFile.open(stored.path)
    parts = list(light_field.video.frames(1, start, stop, chunk=chunk))
    assert all(len(part) <= chunk for part in parts)
    whole = segment_frames(stored.segments[1])[start:stop]
    assert (np.concatenate([whole[:0], *parts]) == whole).all()
    if length:
        assert light_field.video.decoded_frames <= stop - start + 5 + 1


@pytest.mark.parametrize("kind", ["macropixels", "views"])
@pytest.mark.parametrize("views, pixels, pack, order, name", [
    (1, 1, 1, "raster", "yuv420p10le"),
    (1, 7, 2, "serpentine", "gbrp"),
    (5, 7, 3, "hilbert", "gbrp"),
    (3, 10, 4, "serpentine", "yuv444p10le"),
    (16, 4, 1, "raster", "gbrp"),
])  # fmt: skip
def test_parts_equal_the_whole(tmp_path, make_store, kind, views, pixels, pack, order, name):
    layout = FrameLayout(kind, views, pixels, order, pack, name)
    stored = make_store(tmp_path, layout, Encoding("ffv1", name, gop=4))
    light_field = LightFieldFile.open(stored.path)
    whole = everything(light_field)
    error = np.abs(whole / 255 - truth(stored.field)).max()
    assert error <= (0.03 if name == "yuv420p10le" else 0.0041)
    middle, lens = pixels // 2, views // 2
    assert (light_field.macropixel(middle, 0, codes=True) == whole[0, middle]).all()
    assert (light_field.view(lens, views - 1, codes=True) == whole[:, :, views - 1, lens]).all()
    part = light_field.rectangle(middle, 0, pixels, middle + 1, codes=True)
    assert (part == whole[: middle + 1, middle:]).all()


def test_subsampled_colour_does_not_leak_between_neighbours(tmp_path, make_store):
    """Macropixels that share a frame read like those that have one each."""
    found = []
    for pack in (1, 3):
        (tmp_path / str(pack)).mkdir()
        layout = FrameLayout("macropixels", 5, 6, "raster", pack, "yuv420p10le")
        stored = make_store(tmp_path / str(pack), layout, Encoding("ffv1", "yuv420p10le"))
        found.append(everything(LightFieldFile.open(stored.path)))
    assert (found[0] == found[1]).all()


def test_only_what_is_needed_is_decoded(stored):
    tile = LightFieldFile.open(stored.path).segments[1].tile
    for name, where, least, most in (
        # The first frame, and what the decoder runs ahead.
        ("macropixel", (tile.column, tile.row), 1, 3),
        ("rectangle", (0, tile.row, 4, tile.row + 1), 4, 12),  # of the 36 of its segment
        ("view", (0, 0), 144, 144),
    ):
        light_field = LightFieldFile.open(stored.path)
        getattr(light_field, name)(*where, codes=True)
        assert least <= light_field.video.decoded_frames <= most


def test_outside_is_refused(stored):
    light_field = LightFieldFile.open(stored.path)
    for wrong in [
        lambda: light_field.macropixel(12, 0, codes=True),
        lambda: light_field.view(0, -1, codes=True),
        lambda: light_field.rectangle(3, 3, 3, 5, codes=True),
        lambda: list(light_field.video.frames(4)),
        lambda: list(light_field.video.frames(0, 3, 99)),
    ]:
        with pytest.raises(StorageError):
            wrong()
    for call in (default_kind, default_pack, chosen_encoding, macropixel_pack):
        refused("positive", call, 0)


def join_with(stored, tmp_path, segments, tiles=None):
    tiles, out = tiles or stored.tiles, tmp_path / "x.mkv"
    join_segments(out, segments, tiles, stored.layout, geometry=stored.slab, scene=SCENE)


def test_segments_that_do_not_fit_are_refused(tmp_path, stored):
    good, layout = list(stored.segments), stored.layout
    size = layout.frame_width, layout.frame_height
    other = tmp_path / "other.mp4"
    with SegmentWriter(other, Encoding("libx264", "yuv444p", refs=3, bframes=0), *size) as writer:
        writer.write(stored.frames[2])
    short = tmp_path / "short.mp4"
    with SegmentWriter(short, Encoding("libx264", "yuv444p"), *size) as writer:
        writer.write(stored.frames[2][:5])
    small = tmp_path / "small.mp4"
    with SegmentWriter(small, Encoding("libx264", "yuv420p"), 32, 32) as writer:
        writer.write(np.zeros((36, 1536), np.uint8))
    cut = tmp_path / "cut.mp4"
    cut.write_bytes(good[2].read_bytes()[:-100])
    for wrong, words in [
        (other, "other settings"), (short, "has 5 frames"), (small, "32 x 32"), (cut, "cut.mp4"),
        (tmp_path / "none.mp4", "no such file"),
    ]:  # fmt: skip
        refused(words, join_with, stored, tmp_path, [*good[:2], wrong, good[3]])
    refused("3 segments for 4 tiles", join_with, stored, tmp_path, good[:3])
    refused("exactly once", join_with, stored, tmp_path, good[:3], stored.tiles[:3])
    with pytest.raises(StorageError, match="exactly once"):
        join_with(stored, tmp_path, [good[0], *good[:3]], [stored.tiles[0], *stored.tiles[:3]])
    assert not (tmp_path / "x.mkv").exists()


def test_a_file_stays_open_for_any_number_of_threads(tmp_path, make_store):
    spec = Encoding("libx264", "yuv444p", crf=20, preset="veryfast", gop=3)
    made = make_store(tmp_path, FrameLayout("views", 4, 20, pixel_format="yuv444p"), spec)
    with LightFieldFile.open(made.path, threads=3) as field:
        first = field.rectangle(0, 0, 20, 20, codes=True)
        with ThreadPoolExecutor(4) as pool:
            views = list(pool.map(lambda k: field.view(k % 4, k // 4, codes=True), range(16)))
        for k, view in enumerate(views):
            assert (view == first[:, :, k // 4, k % 4]).all()
        made.path.unlink()  # what is open can be read still
        assert (field.view(1, 2, codes=True) == first[:, :, 2, 1]).all()


@pytest.mark.parametrize("codec", ["libx264", "libx265", "libsvtav1", "ffv1"])
def test_batches_join_to_the_same_bytes(tmp_path, make_store, codec):
    """Whatever segments went into a batch: the file is the same."""
    spec = Encoding(codec, "yuv420p", tune=None, preset=PRESETS[codec])
    stored = make_store(tmp_path, macropixels(codec, 8, 12), spec, tiles=5)
    assert len(stored.tiles) >= 5
    batches = [tmp_path / "0.batch", tmp_path / "1.batch"]
    pack_segments(batches[0], stored.segments[:2])
    pack_segments(batches[1], stored.segments[2:])
    again = tmp_path / "again.mkv"
    with unpacked(batches, again) as segments:
        join_segments(
            again, segments, stored.tiles, stored.layout, geometry=stored.slab,
            scene=SCENE, spec=spec,
        )  # fmt: skip
    assert again.read_bytes() == stored.path.read_bytes()
    LightFieldFile.open(again).verify()


def test_a_batch_that_is_damaged_is_named(tmp_path, stored):
    def join(batch):
        with unpacked([batch], tmp_path / "x.mkv") as segments:
            join_with(stored, tmp_path, segments)

    batch = tmp_path / "0.batch"
    pack_segments(batch, stored.segments[:-1])
    refused("3 segments for 4 tiles", join, batch)
    pack_segments(batch, stored.segments)
    data = batch.read_bytes()
    changed = bytearray(data)
    changed[400] ^= 4
    for wrong in (data[: len(data) // 2], bytes(changed), stored.path.read_bytes(), b""):
        batch.write_bytes(wrong)
        refused("batch: ", join, batch)
        assert not (tmp_path / "x.mkv").exists()


READER = Path(__file__).parents[2] / "docs/examples/read_light_field.py"
read = runpy.run_path(str(READER))["read"]


@pytest.mark.parametrize(
    ("layout", "codec"),
    [
        (FrameLayout("views", 3, 20, "serpentine", 1, "yuv444p"), "libx264"),
        (FrameLayout("views", 5, 17, "hilbert", 2, "yuv420p"), "libx264"),
        (FrameLayout("macropixels", 5, 18, "hilbert", 4, "yuv444p10le"), "libx264"),
        (FrameLayout("macropixels", 6, 9, "raster", 2, "gbrp"), "ffv1"),
        (FrameLayout("views", 3, 20, "raster", 1, "yuv420p12le"), "ffv1"),
    ],
)
def test_the_small_reader_reads_what_the_library_reads(tmp_path, make_store, layout, codec):
    stored = make_store(tmp_path, layout, Encoding(codec, layout.pixel_format, crf=20))
    about, rays = read(stored.path)
    n, m = layout.views, layout.pixels
    assert rays.shape == (n, n, m, m, 3) and about["layout"] == layout.to_json()
    expected = LightField.open(stored.path).views(0, 0, n, n, codes=True)
    assert np.abs(np.rint(255 * rays) - expected).max() <= 1


@pytest.mark.parametrize(
    ("name", "version", "size", "mean"),
    [
        ("2026-11-21", 1, (16, 16), 79.9),
        ("content", 1, (16, 16), 80.4),
        ("depth", 1, (32, 32), 83.4),
        ("wide", 2, (32, 16), 75.7),
    ],
)
def test_files_of_earlier_programs_open(name, version, size, mean):
    """Written by the first program, the first with ``content``, with ``depth``, and wide.

    ``mean`` is that of the codes of the picture that this program made of the file.
    """
    field = LightField.open(Path(__file__).parent / "earlier" / f"{name}.mkv")
    field.verify()
    about, rays = read(field.path)
    expected = field.views(0, 0, *field.grid, codes=True)
    assert np.abs(np.rint(255 * rays) - expected).max() <= 1
    assert about["version"] == version and field.picture_size == size
    assert (field.depth_video is not None) == (name == "depth")
    assert abs(display_values(field.refocus()).mean() - mean) < 0.3


def test_very_wide_frames_are_predicted_by_whole_pixels():
    """Else the encoder holds each frame four times: 5 GB at 8192 x 8192."""
    parameters = [
        chosen_encoding(4, by_depth=True, width=width).options(width)["x264-params"]
        for width in (4096, 8192)
    ]
    assert ["subme=0" in each.split(":") for each in parameters] == [False, True]


@pytest.mark.parametrize("views, pixels", [(8, 64), (128, 4)])
def test_a_smooth_light_field_keeps_its_colours(tmp_path, make_store, views, pixels):
    spec = chosen_encoding(views)
    layout = FrameLayout(default_kind(views, pixels), views, pixels, pixel_format=spec.pixel_format)
    stored = make_store(tmp_path, layout, spec)
    found = LightFieldFile.open(stored.path).rectangle(0, 0, pixels, pixels, codes=True) / 255
    means = found.mean((2, 3)) - stored.field.mean((0, 1))
    assert -10 * np.log10(np.mean(means**2)) > 40
