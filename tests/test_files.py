"""Files appear whole or not at all, on full disks, too; pictures come back as written."""

import gzip
import json
import os
import re
import resource
import subprocess
import sys
import tracemalloc
from contextlib import contextmanager
from functools import partial
from zipfile import ZipFile

import cv2
import numpy as np
import OpenEXR
import pytest
from PIL import Image
from plain_scenes import refused, scene, wall

from lfcore import Camera, CameraArray, Encoding, LfcoreError, SensorPlane, Slab, write_picture
from lfcore.colour import srgb_codes, srgb_decode
from lfcore.errors import StorageError
from lfcore.evaluation.true_picture import Reference, load_reference, save_reference
from lfcore.exchange.pictures import read_pfm
from lfcore.exr import exr_bytes, read_exr_picture
from lfcore.files import draft_folder, whole_file, write_json, write_text
from lfcore.optics.plane_pictures import load_stack, save_stack
from lfcore.optics.plane_sums import PlaneSums
from lfcore.pictures import codes_of, decode, picture_size, read_picture, write_pictures
from lfcore.reading import LARGEST_MESH, read_bytes
from lfcore.scene.files import read_scene, save_scene
from lfcore.storage.segment import SegmentWriter, read_segment
from lfcore.storage.tiled_exr import read_array, write_array
from lfcore.tracing.bvh import build_bvh, load_bvh, save_bvh
from tests.robustness.small_disks import writers

NOISE = np.random.default_rng(3).random((96, 96, 3)).astype(np.float32)


def test_several_pictures_appear_together_or_not_at_all(tmp_path):
    (tmp_path / "taken.png").mkdir()
    with pytest.raises(StorageError):
        write_pictures([(tmp_path / "a.png", NOISE), (tmp_path / "taken.png", NOISE)])
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken.png"]


def test_an_exception_leaves_the_old_file(tmp_path):
    write_json(tmp_path / "f.json", {"a": 1})
    with pytest.raises(RuntimeError), whole_file(tmp_path / "f.json") as file:
        file.write(b"half")
        raise RuntimeError
    assert json.loads((tmp_path / "f.json").read_text()) == {"a": 1}
    assert len(list(tmp_path.iterdir())) == 1


HOLD = """
import sys, time
from lfcore.files import draft_folder, whole_file
with whole_file(sys.argv[1]) as file, draft_folder(sys.argv[1]) as folder:
    file.write(b"half")
    (folder / "segment").write_bytes(b"half")
    print("holds", flush=True)
    time.sleep(60)
"""


def test_drafts_of_a_killed_run_are_cleared_and_those_of_a_living_one_kept(tmp_path):
    write = [sys.executable, "-c", "import sys; from lfcore.files import write_text; "
             "write_text(sys.argv[1], 'whole')"]  # fmt: skip
    path = str(tmp_path / ("a name of many bytes \N{SNOWMAN}" * 6 + ".bin"))
    with subprocess.Popen([sys.executable, "-c", HOLD, path], stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"holds\n"
        assert len(list(tmp_path.iterdir())) == 2
        subprocess.run([*write, str(tmp_path / "b")], check=True, timeout=60)
        assert len(list(tmp_path.iterdir())) == 3
        other.kill()
    subprocess.run([*write, str(tmp_path / "c")], check=True, timeout=60)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["b", "c"]


def test_a_draft_has_the_rights_of_any_new_file(tmp_path):
    old = os.umask(0o027)
    try:
        write_text(tmp_path / "f", "text")
        with draft_folder(tmp_path / "g") as folder:
            assert folder.stat().st_mode & 0o777 == 0o750
    finally:
        os.umask(old)
    assert (tmp_path / "f").stat().st_mode & 0o777 == 0o640


ARRAY = CameraArray.on_grid((2, 2), (0, 1, 0, 1), 45.0, (48, 48))
PLANES = [SensorPlane(2.0, 2.0)]
SUMS = PlaneSums.zeros(Slab(Camera(0.05, 0.036, 2.0, 3.0), 4, 16), PLANES)
TRUTH = Reference(PLANES, NOISE[None], np.ones(1))


def write_segment(path):
    with SegmentWriter(path, Encoding("ffv1", "gbrp"), 96, 96) as writer:
        writer.write(np.zeros((4, 3 * 96 * 96), np.uint8))


# What writes a file to a path, and what reads it.
KINDS = {
    "scene.npz": (partial(save_scene, scene=scene(wall(2.0))), read_scene),
    "bvh.npz": (partial(save_bvh, bvh=build_bvh(wall(2.0))), load_bvh),
    "stack.npz": (lambda path: save_stack(path, NOISE[None], PLANES), load_stack),
    "truth.npz": (lambda path: save_reference(path, TRUTH), load_reference),
    "sums.npz": (SUMS.save, lambda path: PlaneSums.load(path, SUMS.slab, PLANES)),
    "array.exr": (lambda path: write_array(path, NOISE, ARRAY), read_array),
    "segment.mp4": (write_segment, read_segment),
    # Of which OpenCV alone would fill up the rest without a word.
    **{f"a{suffix}": (lambda path: write_picture(path, NOISE), read_picture)
       for suffix in (".png", ".jpg", ".tif", ".webp")},
}  # fmt: skip


@pytest.mark.parametrize("name", KINDS)
def test_only_whole_files_are_read(tmp_path, name):
    (write, read), path = KINDS[name], tmp_path / name
    refused(re.escape(name), read, path)
    write(path)
    read(path)
    whole = path.read_bytes()
    spoilt = [whole[: int(part * len(whole))] for part in (0, 0.01, 0.3, 0.7, 0.97)]
    if name.endswith(".npz"):
        flipped, largest = (
            bytearray(whole),
            max(ZipFile(path).infolist(), key=lambda m: m.file_size),
        )
        flipped[largest.header_offset + largest.file_size // 2 + 64] ^= 0xFF
        np.savez(path, other=np.zeros(3))
        spoilt += [bytes(flipped), path.read_bytes()]
    for data in spoilt:
        path.write_bytes(data)
        refused(re.escape(name), read, path)


@contextmanager
def files_of_at_most(size):
    """Bytes beyond are refused as on a full disk: a write is cut short, and the next one fails."""
    before, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, most))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (before, most))


def test_a_disk_that_fills_is_said_and_leaves_nothing(tmp_path):
    for writer in writers(tmp_path):
        folder = tmp_path / writer.name
        folder.mkdir()
        whole, cut = folder / f"whole.{writer.file}", folder / f"cut.{writer.file}"
        writer.write(whole)
        size = whole.stat().st_size
        for limit in (size - 1, size - 1 - size // 50, size // 2, 1):
            with files_of_at_most(limit), pytest.raises(LfcoreError) as error:
                writer.write(cut)
            assert str(error.value).startswith(f"{cut}: cannot be written: File too large")
            assert list(folder.iterdir()) == [whole]


@pytest.mark.parametrize("suffix", [".ply", ".ply.gz"])
def test_reading_takes_memory_for_the_file_alone(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    path.write_bytes(gzip.compress(b"ply") if "gz" in suffix else b"ply")
    tracemalloc.start()
    assert read_bytes(path, LARGEST_MESH) == b"ply"
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 << 20
    path.write_bytes(gzip.compress(bytes(99)) if "gz" in suffix else bytes(99))
    refused("holds more than 98 bytes", read_bytes, path, 98)


CODES = np.random.default_rng(3).integers(0, 256, (13, 17, 3), np.uint8)
LIGHT = np.random.default_rng(4).random((13, 17, 3)).astype(np.float32)


@pytest.mark.parametrize("suffix", [".png", ".ppm", ".bmp", ".tif", ".tiff"])
def test_codes_come_back(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    write_picture(path, CODES)
    with Image.open(path) as image:  # an independent reader
        assert (np.asarray(image.convert("RGB")) == CODES).all()
    assert (read_picture(path) == CODES).all()
    write_picture(path, LIGHT)
    assert (read_picture(path) == srgb_codes(LIGHT)).all()


@pytest.mark.parametrize("suffix", [".png", ".tif"])
def test_sixteen_bits_come_back(tmp_path, suffix):
    deep = CODES.astype(np.uint16) * 257 + 3
    write_picture(tmp_path / f"a{suffix}", deep)
    found = read_picture(tmp_path / f"a{suffix}")
    assert found.dtype == np.uint16 and (found == deep).all()


def test_light_comes_back_as_floats(tmp_path):
    write_picture(tmp_path / "a.npy", LIGHT)
    assert (np.load(tmp_path / "a.npy") == LIGHT).all()
    write_picture(tmp_path / "a.exr", LIGHT)
    assert (read_exr_picture(tmp_path / "a.exr") == LIGHT).all()
    write_picture(tmp_path / "a.pfm", LIGHT)
    data = (tmp_path / "a.pfm").read_bytes()
    values = np.frombuffer(data[-LIGHT.nbytes :], "<f4").reshape(LIGHT.shape)
    kind, size, scale, _ = data.split(b"\n", 3)
    assert (kind, size, float(scale)) == (b"PF", b"17 13", -1) and (values[::-1] == LIGHT).all()


def test_what_is_not_there_is_said(tmp_path):
    refused(r"none\.png: picture not found", read_picture, tmp_path / "none.png")
    refused(r"a\.gif: unknown format", write_picture, tmp_path / "a.gif", CODES)
    for shape in ((2, 2, 7), (1, 70_000, 3)):  # a JPEG has at most 65,535 columns
        refused(r"a\.jpg: ", write_picture, tmp_path / "a.jpg", np.zeros(shape, np.uint8))
    assert not list(tmp_path.iterdir())


GREY = np.arange(256, dtype=np.uint16).reshape(16, 16)
RAMP = GREY.astype(np.uint8)
SAVED = {
    "grey of 16 bits.png": Image.fromarray(GREY * 257),
    "grey of 16 bits.tif": Image.fromarray(GREY * 257),
    "grey of 16 bits.pgm": Image.fromarray(GREY * 257),
    "grey.tga": Image.fromarray(RAMP),
    "palette.png": Image.fromarray(RAMP, "P"),
    "grey and alpha.png": Image.fromarray(np.dstack([RAMP, RAMP]), "LA"),
}


@pytest.mark.parametrize("name", SAVED)
def test_every_kind_of_codes_is_read(tmp_path, name):
    image = SAVED[name]
    if image.mode == "P":
        image.putpalette(np.repeat(np.arange(256, dtype=np.uint8), 3).tobytes())
        image.info["transparency"] = bytes(range(256))
    image.save(tmp_path / name)
    np.testing.assert_array_equal(codes_of(read_picture(tmp_path / name))[..., 1], GREY)
    alpha = codes_of(decode((tmp_path / name).read_bytes(), alpha=True))[..., 3]
    np.testing.assert_array_equal(alpha, GREY if "alpha" in name or "pal" in name else 255)
    assert picture_size(tmp_path / name) == (16, 16)


def test_colours_of_16_bits_keep_their_alpha(tmp_path):
    codes = np.dstack([GREY * 257, GREY * 200, GREY * 100, GREY * 50])
    _, png = cv2.imencode(".png", codes)
    np.testing.assert_array_equal(decode(png.tobytes(), alpha=True), codes[..., [2, 1, 0, 3]])


def test_floats_of_a_tiff_are_light(tmp_path):
    Image.fromarray(LIGHT[..., 0]).save(tmp_path / "a.tif")
    np.testing.assert_array_equal(read_picture(tmp_path / "a.tif")[..., 2], LIGHT[..., 0])


@pytest.mark.parametrize("window", [(2, 1, 9, 7), (-3, -2, 20, 15), (30, 30, 40, 40)])
def test_an_exr_is_its_display_window(tmp_path, window):
    """Black outside the data window, and cut where that is larger."""
    left, top, right, bottom = window
    part = np.random.default_rng(1).random((bottom - top, right - left, 3)).astype(np.float32)
    corners = [np.array(at, np.int32) for at in ((left, top), (right - 1, bottom - 1))]
    shown = tuple(np.array(at, np.int32) for at in ((0, 0), (16, 12)))
    data = exr_bytes(part, {"dataWindow": tuple(corners), "displayWindow": shown})
    (tmp_path / "a.exr").write_bytes(data)
    found = read_picture(tmp_path / "a.exr")
    expected = np.zeros((100, 100, 3), np.float32)
    expected[50 + top : 50 + bottom, 50 + left : 50 + right] = part
    np.testing.assert_array_equal(found, expected[50:63, 50:67])
    assert picture_size(tmp_path / "a.exr") == (17, 13)


def test_colours_of_an_exrs_only_layer(tmp_path):
    planes = {f"ViewLayer.Combined.{c}": LIGHT[..., k].copy() for k, c in enumerate("RGB")}
    planes["ViewLayer.Depth.Z"] = LIGHT[..., 0].copy()
    head = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(head, planes) as file:
        file.write(str(tmp_path / "a.exr"))
    np.testing.assert_array_equal(read_picture(tmp_path / "a.exr"), LIGHT)


def test_radiance_undoes_its_exposure(tmp_path):
    (tmp_path / "a.hdr").write_bytes(cv2.imencode(".hdr", LIGHT[..., ::-1])[1].tobytes())
    plain = read_picture(tmp_path / "a.hdr")
    np.testing.assert_allclose(plain, LIGHT, atol=0.01)
    data = (tmp_path / "a.hdr").read_bytes()
    head = b"#?RGBE\nEXPOSURE=2\nFORMAT=32-bit_rle_rgbe\nEXPOSURE= 0.25\nCOLORCORR=1 2 1\n\n"
    (tmp_path / "a.hdr").write_bytes(head + data[data.index(b"-Y") :])
    found = read_picture(tmp_path / "a.hdr")
    np.testing.assert_allclose(found, plain * 2 / [1, 2, 1], rtol=1e-6)
    assert picture_size(tmp_path / "a.hdr") == (17, 13)
    for old, new in ((b"EXPOSURE=2", b"EXPOSURE=0"), (b"-Y", b"+Y"), (b"_rgbe\n", b"_xyze\n")):
        (tmp_path / "a.hdr").write_bytes((head + data[data.index(b"-Y") :]).replace(old, new))
        refused(r"a\.hdr: ", read_picture, tmp_path / "a.hdr")


@pytest.mark.parametrize("suffix", [".exr", ".pfm"])
def test_codes_of_16_bits_become_linear_light(tmp_path, suffix):
    path = tmp_path / f"a{suffix}"
    codes = np.full((4, 4, 3), 32768, np.uint16)
    write_picture(path, codes)
    read = read_exr_picture(path) if suffix == ".exr" else read_pfm(path)
    np.testing.assert_allclose(read, srgb_decode(np.float32(32768 / 65535)), rtol=1e-6)
