"""Disks that fill while a file is written: the file must be whole, or refused and absent."""

import ctypes
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lfcore.files import write_json, write_text
from lfcore.film import write_film
from lfcore.optics.array import CameraArray
from lfcore.optics.camera import Camera
from lfcore.optics.plane_sums import PlaneSums
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.pictures import write_picture
from lfcore.readers.load import load_scene
from lfcore.scene.files import save_scene
from lfcore.storage.container import join_segments
from lfcore.storage.layout import FrameLayout
from lfcore.storage.segment import SegmentWriter
from lfcore.storage.tiled_exr import write_array
from lfcore.tracing.bvh import build_bvh, save_bvh
from robustness.children import Limits, judged
from robustness.outcome import OK, REFUSED, ROOT, Outcome, SilentlyWrong, outcome_of
from robustness.targets.stores import CODECS
from tests.robustness.kills import Killed

PAGE = os.sysconf("SC_PAGE_SIZE")
"""The bytes of a page of memory, the unit of a disk's size."""
MOST_TRIES = 40
"""The most sizes of a disk per file; small files are tried page by page."""


class Writer(NamedTuple):
    """``write`` writes the ``file``, always with the same content."""

    name: str
    file: str
    write: Callable[[Path], object]


def writers(home: Path) -> list[Writer]:
    """Return a writer per kind of file, each of some tens to hundreds of kilobytes."""
    noise = np.random.default_rng(3)
    picture = noise.random((96, 128, 3), np.float32)
    array = CameraArray.on_grid((2, 2), (-1, 1, -1, 1), 40.0, (64, 48))
    scene = load_scene(ROOT / "scenes/sphere", bare=True)
    bvh = build_bvh(scene.triangles)
    layout = FrameLayout("macropixels", 16, 24, pixel_format="yuv444p")
    tiles = layout.tiles(layout.rays, least=2, small_rays=0)
    segments = [home / f"{tile.index}.mp4" for tile in tiles]
    frames = noise.integers(0, 255, (tiles[0].frame_count, layout.frame_bytes), np.uint8)

    def segment(path: Path) -> None:
        with SegmentWriter(path, CODECS["x264"], layout.frame_width, layout.frame_height) as writer:
            writer.write(frames)

    for path in segments:
        segment(path)

    slab = Slab(Camera(0.05, 0.036, 2.0, 3.0), layout.views, layout.pixels)
    sums = PlaneSums.zeros(slab, [SensorPlane(2.0, 2.0)])

    def join(path: Path) -> None:
        about = {"name": "noise", "digest": ""}
        join_segments(path, segments, tiles, layout, geometry=slab, scene=about)

    kinds = ("png", "jpg", "ppm", "exr", "npy", "pfm")
    draw = partial(write_picture, picture=picture)
    return [
        *(Writer(f"picture {kind}", f"p.{kind}", draw) for kind in kinds),
        Writer("tiled EXR", "t.exr", lambda path: write_array(path, picture, array)),
        Writer("segment", "s.mp4", segment),
        Writer("light field", "l.mkv", join),
        Writer("scene", "scene.npz", lambda path: save_scene(path, scene)),
        Writer("hierarchy", "bvh.npz", lambda path: save_bvh(path, bvh)),
        Writer("sums of planes", "sums.npz", sums.save),
        Writer("film", "f.mp4", lambda path: write_film(path, picture[None], 12)),
        Writer("table", "t.csv", lambda path: write_text(path, "1.5,2.5\n" * 9000)),
        Writer("JSON", "t.json", lambda path: write_json(path, list(range(9000)))),
    ]


def fill(writer: Writer, home: Path) -> list[tuple[int, Outcome]]:
    """Return (pages, outcome) for disks from empty to large enough.

    Raises :class:`OSError` if no small disk can be mounted.
    """
    reference = home / writer.file
    writer.write(reference)
    whole = reference.read_bytes()
    again = home / f"again-{writer.file}"
    writer.write(again)
    if again.read_bytes() != whole:
        raise RuntimeError(f"two files of {writer.name} differ")
    need = -(-len(whole) // PAGE)
    step = max(1, need // MOST_TRIES)
    # One page for the folder; a few more than the file's, as the muxer writes its head twice.
    pages = [1, *range(2, need + 8, step), 4 * need + 64]
    mount = home / "disk"
    mount.mkdir(exist_ok=True)

    def judge(count: int) -> Outcome:
        file = mount / writer.file
        before = b"before" if pages.index(count) % 2 else b""
        with small_disk(mount, (count + bool(before)) * PAGE):
            if before:
                file.write_bytes(before)
            return outcome_of(lambda: _write(writer, file, whole, before), names=str(file))

    outcomes = judged(pages, judge, Limits(), home / "stack.txt")
    return list(zip(pages, outcomes, strict=True))


def _write(writer: Writer, file: Path, whole: bytes, before: bytes) -> None:
    """Write the file; after a refusal the folder must be as before."""
    right = before
    try:
        writer.write(file)
        right = whole
    finally:
        left = sorted(path.name for path in file.parent.iterdir())
        if left != ([file.name] if right else []):
            raise SilentlyWrong(f"the folder has {left}")
        if right and file.read_bytes() != right:
            size = file.stat().st_size
            raise SilentlyWrong(f"{size} bytes under its name instead of {len(right)}")


def fill_workflow(run: Killed, pages: Sequence[int]) -> list[tuple[int, Outcome]]:
    """Return (pages, outcome) of runs that fill the results' disk, and run again with more room."""

    def judge(count: int) -> Outcome:
        run.clean()
        results = run.folder / "results"
        results.mkdir()
        with small_disk(results, count * PAGE) as resize:
            status, output = run.run()
            if status == 0 or "Traceback" in output:
                return Outcome("silent wrong", f"status {status} on a full disk", output)
            resize(1 << 30)
            status, output = run.run()
            if status:
                return Outcome("silent wrong", f"then status {status}", output)
            if run.digests() != run.whole:
                return Outcome("silent wrong", "then other results", str(run.digests()))
        return Outcome(REFUSED)

    limits = Limits(cpu=1e4, wall=1200, memory=None, file=1 << 40)
    outcomes = judged(pages, judge, limits, run.folder / "stack.txt")
    return list(zip(pages, outcomes, strict=True))


REMOUNT = 32
"""Linux's MS_REMOUNT."""
DETACH = 2
"""Linux's MNT_DETACH."""
NEW_USER = 0x10000000
"""Linux's CLONE_NEWUSER."""
NEW_MOUNTS = 0x00020000
"""Linux's CLONE_NEWNS."""
PRIVATE_RECURSIVE = (1 << 18) | (1 << 14)
"""Linux's MS_PRIVATE and MS_REC."""
LIBC = ctypes.CDLL(None, use_errno=True)


@contextmanager
def small_disk(folder: Path, size: int) -> Iterator[Callable[[int], None]]:
    """Mount a file system of ``size`` bytes in memory at ``folder``, visible to this process alone.

    Yields a function that changes the size.  Needs the right to mount, or to create user name
    spaces.
    """

    def mount(size: int, flags: int = REMOUNT) -> None:
        _call(LIBC.mount, b"none", bytes(folder), b"tmpfs", flags, b"size=%d" % size)

    own_mounts()
    mount(size, 0)
    try:
        yield mount
    finally:
        _call(LIBC.umount2, bytes(folder), DETACH)  # even with open files


@cache
def own_mounts() -> None:
    """Enter a private mount name space: later mounts end with this process."""
    user, group = os.getuid(), os.getgid()
    _call(LIBC.unshare, NEW_MOUNTS if user == 0 else NEW_MOUNTS | NEW_USER)
    if user:
        Path("/proc/self/setgroups").write_text("deny")
        Path("/proc/self/uid_map").write_text(f"0 {user} 1")
        Path("/proc/self/gid_map").write_text(f"0 {group} 1")
    _call(LIBC.mount, b"none", b"/", None, PRIVATE_RECURSIVE, None)


def _call(function, *arguments) -> None:
    if function(*arguments):
        number = ctypes.get_errno()
        raise OSError(number, f"{function.__name__}: {os.strerror(number)}")


def can_mount(home: Path) -> str:
    """Return the reason why small disks cannot be mounted; empty if they can."""
    mount = home / "probe"
    mount.mkdir(parents=True, exist_ok=True)

    def judge(size: int) -> Outcome:
        try:
            with small_disk(mount, size):
                return Outcome(OK)
        except OSError as error:
            return Outcome(REFUSED, text=str(error))

    (outcome,) = judged([PAGE], judge, Limits(), home / "probe.txt")
    return outcome.text
