"""Damaged, foreign and contradictory files: never a wrong pixel, always a reason and a name.

Bits that flip anywhere, and metadata of wrong types, are the fuzzer's
(robustness/targets/stores.py).
"""

import hashlib
import json
import re
from fractions import Fraction
from itertools import pairwise

import av
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plain_scenes import refused

from lfcore.storage.index import _covers
from lfcore.storage.lightfield import LightFieldFile
from lfcore.storage.metadata import TAG


def counted(tiles, column, row, columns, rows):
    """Whether each element of a rectangle is in one tile, and no other element in any."""
    times = np.zeros((40, 40), int)
    for left, top, width, height in tiles:
        times[top : top + height, left : left + width] += 1
    wanted = np.zeros_like(times)
    wanted[row : row + rows, column : column + columns] = 1
    return np.array_equal(times, wanted)


cuts = st.sets(st.integers(1, 11), max_size=3).map(lambda inner: [0, *sorted(inner), 12])


@given(data=st.data(), column=st.integers(0, 5), row=st.integers(0, 5), across=cuts, down=cuts)
def test_tiles_that_cover_an_extent_once_are_told_from_others(data, column, row, across, down):
    extent = column, row, 12, 12
    tiles = data.draw(st.permutations([
        (column + left, row + top, right - left, bottom - top)
        for left, right in pairwise(across) for top, bottom in pairwise(down)
    ]))  # fmt: skip
    assert counted(tiles, *extent) and _covers(np.array(tiles), *extent)
    place = data.draw(st.integers(0, len(tiles) - 1))
    moved = list(tiles[place])
    moved[data.draw(st.integers(0, 3))] += data.draw(st.integers(1, 4))
    for wrong in (
        [*tiles[:place], *tiles[place + 1 :]],
        [*tiles, tiles[place]],
        [*tiles[:place], tuple(moved), *tiles[place + 1 :]],
    ):
        assert not counted(wrong, *extent)
        assert not _covers(np.array(wrong).reshape(-1, 4), *extent)


@pytest.fixture(scope="module")
def whole(stored):
    """(bytes of the file, all of its pixels)."""
    return stored.path.read_bytes(), LightFieldFile.open(stored.path).rectangle(
        0, 0, 12, 12, codes=True
    )


def salvaged(path, pixels):
    """Open to salvage: pixels of whole segments must be right, all others black."""
    light_field = LightFieldFile.open(path, salvage=True)
    found, known = light_field.rectangle(0, 0, 12, 12, codes=True), np.zeros((12, 12), bool)
    for part in light_field.segments:
        tile = part.tile
        known[tile.row : tile.row + tile.rows, tile.column : tile.column + tile.columns] = True
    assert (found[known] == pixels[known]).all() and not found[~known].any()
    assert len(light_field.segments) + len(light_field.damage) == 4
    return light_field


def test_a_cluster_that_lost_its_time(tmp_path, whole):
    """Its packets claim the numbers of others: none of these is taken for the other."""
    data, pixels = whole
    clusters = [m.start() for m in re.finditer(rb"\x1f\x43\xb6\x75", data)]
    assert len(clusters) > 2
    for cluster in clusters[1:]:
        time = data.index(b"\xe7", cluster + 4, cluster + 24)  # the element's id
        changed = bytearray(data)
        changed[time] ^= 0x10
        path = tmp_path / "lost.mkv"
        path.write_bytes(changed)
        refused(re.escape(str(path)), LightFieldFile.open(path).verify)
        assert salvaged(path, pixels).damage


@pytest.mark.parametrize("share", [0.9, 0.7, 0.4])
def test_a_file_that_is_cut_short_is_one_line(tmp_path, whole, share):
    (data, pixels), path = whole, tmp_path / "a.mkv"
    path.write_bytes(data[: int(len(data) * share)])
    error = str(refused(r"of its 36 frames.* 4 segments can", LightFieldFile.open, path))
    assert str(path) in error and "\n" not in error
    assert len(salvaged(path, pixels).segments) <= 3


def test_a_damaged_segment_is_named_before_any_frame(tmp_path, stored, whole):
    data, pixels = whole
    middle = LightFieldFile.open(stored.path)
    target = next(iter(middle.video.frames(2)))  # readable before
    assert len(target)
    changed = bytearray(data)
    with av.open(str(stored.path)) as container:
        packet = next(p for p in container.demux(video=0) if p.pts == middle.segments[2].first * 40)
    changed[packet.pos + 60] ^= 0x10
    path = tmp_path / "flipped.mkv"
    path.write_bytes(changed)
    light_field = LightFieldFile.open(path)
    refused(r"segment 2 .*check sum", next, light_field.video.frames(2))
    assert (light_field.macropixel(0, 0, codes=True) == pixels[0, 0]).all()
    tile = middle.segments[2].tile
    refused("segment 2", light_field.macropixel, tile.column, tile.row, codes=True)
    refused(r"3 of 4 segments can still be read, not 2", light_field.verify)
    assert [damage.segment.index for damage in salvaged(path, pixels).damage] == [2]


def remux(source, path, keep=lambda number: True, text=None):
    """Copy the video of ``source`` as any program might, some packets left out."""
    with av.open(str(source)) as old, av.open(str(path), "w", format="matroska") as new:
        stream = new.add_stream_from_template(old.streams.video[0], opaque=True)
        stream.time_base = Fraction(1, 1000)
        text = old.metadata[TAG] if text is None else text
        if text:
            new.metadata[TAG] = text
        for index, packet in enumerate(p for p in old.demux(video=0) if p.size):
            packet.dts = (index - 4) * 40
            packet.stream = stream
            if keep(packet.pts // 40):
                new.mux(packet)


def test_a_remuxed_copy_still_opens(tmp_path, stored, whole):
    remux(stored.path, tmp_path / "copy.mkv")
    light_field = LightFieldFile.open(tmp_path / "copy.mkv")
    light_field.verify()
    assert (light_field.rectangle(0, 0, 12, 12, codes=True) == whole[1]).all()


@pytest.mark.parametrize("missing", [1, 3])
def test_a_missing_segment(tmp_path, stored, whole, missing):
    gone = LightFieldFile.open(stored.path).segments[missing]
    path = tmp_path / "short.mkv"
    remux(stored.path, path, lambda number: not gone.first <= number < gone.stop)
    refused(f"segment {missing} .* has 0 of its 36 frames", LightFieldFile.open, path)
    assert [d.segment.index for d in salvaged(path, whole[1]).damage] == [missing]


def test_a_missing_frame(tmp_path, stored):
    path = tmp_path / "short.mkv"
    remux(stored.path, path, lambda number: number != 41)
    refused(
        r"segment 1 .* has 35 of its 36 frames", list, LightFieldFile.open(path).video.frames(1)
    )


def test_foreign_files(tmp_path, stored):
    path = tmp_path / "f.mkv"
    for data in (b"", b"no video at all" * 100, stored.segments[0].read_bytes()):
        path.write_bytes(data)
        refused("not a Matroska file|cannot be opened as a video", LightFieldFile.open, path)
    remux(stored.path, path, text="")
    refused("no light field", LightFieldFile.open, path)
    refused("no such file", LightFieldFile.open, tmp_path / "absent.mkv")


@pytest.mark.parametrize("change, words", [
    (("frame", 0), "damaged"),  # without a new digest
    (("pixels", 13), "slab has|tiles"), (("pixel_format", "yuv420p"), "yuv4"),
    (("pack", 2), "tile"), (("kind", "views"), "tile|segment"),
])  # fmt: skip
def test_metadata_that_contradict(tmp_path, stored, change, words):
    metadata = LightFieldFile.open(stored.path).metadata
    text, (key, value) = metadata.to_text(), change
    if key == "frame":
        text = text.replace('"views":6', '"views":7')
    else:
        text = signed(text, lambda data: data["layout"].update({key: value}))
    remux(stored.path, tmp_path / "x.mkv", text=text)
    refused(words, lambda: next(LightFieldFile.open(tmp_path / "x.mkv").video.frames(0)))


def signed(text, change):
    """Metadata that ``change`` was made to, with a digest that is right again."""
    data = json.loads(text)
    data.pop("digest")
    change(data)
    canonical = json.dumps(data, sort_keys=True, separators=(",", ":"))
    data["digest"] = hashlib.sha256(canonical.encode()).hexdigest()
    return json.dumps(data)


def test_a_file_whose_unit_of_time_has_no_whole_number_per_frame_is_refused(whole, tmp_path):
    """40 ms are 13.3 units of 3 ms."""
    millisecond, other = (b"\x2a\xd7\xb1\x83" + n.to_bytes(3) for n in (1_000_000, 3_000_000))
    data = whole[0].replace(millisecond, other)
    assert data != whole[0]
    (path := tmp_path / "time.mkv").write_bytes(data)
    refused(re.escape(str(path)), lambda: LightFieldFile.open(path).verify())
