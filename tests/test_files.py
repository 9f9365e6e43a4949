"""Files appear whole or not at all, also when the disk is full or the process is killed."""

import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from lfcore.errors import StorageError
from lfcore.files import draft_folder, whole_file, write_json, write_text

BIG = np.random.default_rng(0).random((96, 96, 3)).astype(np.float32)
# What writes each kind of file, in words of Python; ``path`` is where.
WRITERS = {
    "ppm": "write_picture(path, BIG)",
    "png": "write_picture(path, BIG)",
    "jpg": "write_picture(path, BIG)",
    "exr": "write_picture(path, BIG)",
    "npy": "write_picture(path, BIG)",
    "pfm": "write_picture(path, BIG)",
    "npz": "SUMS.save(Path(path))",
    "json": "write_json(path, BIG.tolist())",
    "array.exr": "write_array(path, BIG, ARRAY)",
    "mp4": "write_film(Path(path), BIG[None], 12)",
    "segment.mp4": "segment(path)",
    "mkv": "join_segments(Path(path), [PART], [TILE], TILE.layout, geometry=SLAB, scene=SCENE)",
}
PROGRAM = """
import os, resource, signal, sys, tempfile
from contextlib import ExitStack
from pathlib import Path
import numpy as np
from lfcore.film import write_film
from lfcore.errors import LfcoreError
from lfcore.files import *
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.pictures import write_picture
from lfcore.storage.codecs import Encoding
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.tiled_exr import write_array
from lfcore.storage.ycbcr import frames_from_rgb

BIG = np.random.default_rng(0).random((96, 96, 3)).astype(np.float32)
ARRAY = CameraArray.on_grid((2, 2), (0, 1, 0, 1), 45.0, (48, 48))
TILE = FrameLayout("views", 2, 96, pixel_format="gbrp").tile(0, 0, 2, 2)
SLAB = Slab(Camera(0.05, 0.036, 2.0, 3.0), 2, 96)
SUMS = PlaneSums.zeros(SLAB, [SensorPlane(2.0, 2.0)])
SCENE = {"name": "noise", "digest": "0"}
def segment(path):
    with SegmentWriter(Path(path), Encoding("ffv1", "gbrp"), 96, 96) as writer:
        writer.write(np.tile(frames_from_rgb(BIG[None], "gbrp"), (4, 1)))
PART = Path(tempfile.mkdtemp()) / "0.mp4"
segment(PART)
folder, suffix, code = sys.argv[1:]
path = f"{folder}/whole.{suffix}"
def write(path):
    with ExitStack() as stack:
        exec(code)
write(path)
size = os.path.getsize(path)
for limit in (size - 1, size - 1 - size // 50, size // 2, 1):
    path = f"{folder}/cut.{suffix}"
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    try:
        write(path)
    except LfcoreError as error:
        print(str(error))
    else:
        print(f"wrote {limit} of {size} bytes")
"""


@pytest.mark.parametrize("suffix", WRITERS)
def test_a_disk_that_fills_is_said_and_leaves_nothing(tmp_path, suffix):
    """As a full disk does: the last write is cut short, and the next one fails."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, str(tmp_path), suffix, WRITERS[suffix]],
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    said = done.stdout.splitlines()
    assert len(said) == 4
    for line in said:
        assert line.startswith(f"{tmp_path}/cut.{suffix}: cannot be written: File too large")
    assert [entry.name for entry in tmp_path.iterdir()] == [f"whole.{suffix}"]


def test_several_pictures_appear_together_or_not_at_all(tmp_path):
    from lfcore.pictures import write_pictures

    (tmp_path / "taken.png").mkdir()
    with pytest.raises(StorageError):
        write_pictures([(tmp_path / "a.png", BIG), (tmp_path / "taken.png", BIG)])
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
    assert time.time() - (tmp_path / "f").stat().st_mtime < 60
