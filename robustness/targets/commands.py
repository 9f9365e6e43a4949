"""The command line: hostile values of options, up to the opening of a device."""

import contextlib
import io
import json
import shutil
from collections.abc import Sequence
from pathlib import Path
from unittest import mock

import numpy as np
from hypothesis import strategies as st
from PIL import Image

from lfcore.errors import DeviceError
from robustness.inputs import Inputs, number_texts, texts
from robustness.outcome import Outcome, judge_message, outcome_of
from robustness.targets import Target, seeds_folder
from robustness.targets.pictures import exr_seeds
from robustness.targets.scenes import PBRT_SPHERE, PLAIN, write_sides
from robustness.targets.stores import whole_store

COMMANDS = (
    "info store.mkv", "info store.mkv --verify --json", "info store.mkv --salvage",
    "view store.mkv -o out/v.png", "view store.mkv --view 0 1 -o out/v.exr",
    "view store.mkv --macropixel 1 2 -o out/v.npy", "view store.mkv --grid 2 -o out/v.ppm",
    "refocus store.mkv -o out/r.png --focus 3 --f-number 4 --aperture polygon:5",
    "refocus store.mkv -o out/r.npy --plane focus=2,f_number=2 --plane focus=6 --filter bilinear",
    "refocus store.mkv -o out/r.exr --plane planes.csv --method slicing",
    "stack store.mkv --focus 2 3 4 -o out/s.mp4", "stack store.mkv --focus 2 3 -o out/s.png",
    "render scene.yaml -o out/p.png --pixels 16 --views 2 --focus 2.5 --f-number 1.4",
    "render scene.pbrt -o out/p.exr",
    "render mesh.obj -o out/p.png --pixels 8 --views 1 --filter nearest",
    "record scene.yaml -o out/t.mkv --pixels 16 --views 4 --crf 18 --codec libx264,layout=views",
    "record mesh.ply -o out/t.mkv --pixels 16 --views 4 --codec ffv1,pixel_format=gbrp",
    "plenoptic scene.yaml -o out/p.png", "depth scene.yaml -o out/d.npz --pixels 16",
    "render scene.yaml -o out/p.png --quality-db 40 --pixels 16 --bits 16",
    "render scene.pbrt -o out/p.exr --samples 2:2 --light-points 4",
    "refocus store.mkv -o out/r.png --plane planes.yaml --aperture polygon:6:10 --normalise lens",
    "export store.mkv --format hci -o out/h --views 2x2 --baseline 6.25mm --crop 4x4+1+1",
    "export store.mkv --format quilt:2x2 -o out/q",
    "export store.mkv --format nerfstudio -o out/n",
    "import views -o out/i.mkv --views 2x2 --order rows-up --codec ffv1",
    "import views -o out/i.mkv --views 2x2 --baseline 6mm --field-of-view 40 --focus 1.2",
    "imgtool convert in.exr out/c.png", "imgtool convert --scale 2 --tonemap in.exr out/c.jpg",
    "imgtool store --camsperdim 2 2 --griddim -1 1 -1 1 --inputfov 40 in.exr out/i.mkv",
    "imgtool tiles store.mkv out/t.exr",
    "imgtool lightfield --camsperdim 2 2 --griddim -1 1 -1 1 --focalplanez 4 in.exr out/l.exr",
    "imgtool lightfield --montecarlo --lensradius 0.1 --samplesperpixel 2 in.exr out/l.exr",
    "imgtool lightfield --lens lens.dat,stop=3 in.exr out/l.exr",
)  # fmt: skip


def seeds(folder: Path) -> list[bytes]:
    whole_store("x264", folder)
    exr_seeds(folder)
    return [json.dumps(line.split()).encode() for line in COMMANDS]


def damaged_words(seeds: Sequence[bytes]) -> Inputs:
    """Return command lines with one to three words changed."""
    lines = [json.loads(seed) for seed in seeds]
    words = number_texts | texts | st.sampled_from(sorted({w for line in lines for w in line}))

    @st.composite
    def damaged(draw: st.DrawFn) -> bytes:
        line = [*draw(st.sampled_from(lines))]
        for _ in range(draw(st.integers(1, 3))):
            at = draw(st.integers(0, len(line)))
            replaced = draw(st.integers(0, 2))
            line[at : at + replaced] = draw(st.lists(words, max_size=2))
        return json.dumps([_argument(word) for word in line]).encode()

    return damaged()


def _argument(word: str) -> str:
    """Return a word that the system can pass: without NUL, with surrogates only for bytes, and with
    limited length."""
    word = word.encode("utf-8", "surrogatepass").decode("utf-8", "surrogateescape")
    return word.replace("\0", "")[:100_000]


def write_all_sides(folder: Path) -> None:
    home = seeds_folder(folder)
    write_sides(folder)
    (folder / "fifo").unlink()  # commands may wait for a pipe
    (folder / "scene.yaml").write_text(PLAIN)
    (folder / "scene.pbrt").write_text(PBRT_SPHERE)
    (folder / "planes.csv").write_text("focus,f_number,aperture\n2.0,2.8,circle\n4.0,5.6,square\n")
    (folder / "lens.dat").write_text("50 5 1.5 20\n-50 40 1 20\n")
    (folder / "planes.yaml").write_text("[{focus: 2, f_number: 2.8}, {focus: 4, aperture: square}]")
    (folder / "views").mkdir()
    for index in range(4):
        codes = np.full((16, 16, 3), 40 * index, np.uint8)
        Image.fromarray(codes).save(folder / "views" / f"view{index}.png")
    (folder / "store.mkv").write_bytes(whole_store("x264", home)[0])
    (folder / "in.exr").write_bytes((home / "plain.exr").read_bytes())


def no_device(*_, **__) -> None:
    raise DeviceError("no device is opened here", key="device")


def judge(data: bytes, folder: Path) -> Outcome:
    """Run a command: status 0, 1 with one line, or 2 with the usage; failures leave no file."""
    from lfcore.cli import main

    words = json.loads(data)
    out = folder / "out"
    shutil.rmtree(out, ignore_errors=True)  # files of a child that died
    out.mkdir()
    errors, output = io.StringIO(), io.StringIO()
    status: list[object] = []

    def work() -> None:
        with (
            mock.patch("lfcore.opencl.device._choose", no_device),
            contextlib.redirect_stderr(errors),
            contextlib.redirect_stdout(output),
            contextlib.chdir(folder),
        ):
            try:
                status.append(main(words))
            except SystemExit as end:  # argparse's
                status.append(end.code)

    outcome = outcome_of(work, names=None)
    if outcome.is_finding:
        return outcome
    left = sorted(file.name for file in out.rglob("*") if file.is_file())
    return _judged(status[0], errors.getvalue(), left, words)


def _judged(status: object, errors: str, left: list[str], words: list[str]) -> Outcome:
    if status == 0:
        drafts = [name for name in left if name.startswith(".")]
        return Outcome("left over", f"drafts of {words[0]}", str(left)) if drafts else Outcome("ok")
    if left:
        return Outcome("left over", f"files of {words[0]} that failed", f"{left} {errors}")
    if status == 2:
        return Outcome("refused")
    if status != 1:
        return Outcome("status", f"status {status} of {words[0]}", errors)
    # Notes, as on a scene or on damage, may precede the error.
    return judge_message(errors.strip("\n").rpartition("\n")[2], names=None)


def targets() -> list[Target]:
    return [Target("commands", seeds, damaged_words, judge, write_all_sides, takes_seeds=False)]
