"""Run other programs' readers on the output of ``lfcore export``, and compare what they read.

    python -m benchmarks.interop.run --work /tmp/interop [--only plenpy,...]
        [--source lftoolbox=FOLDER] [--source hci-tools=FOLDER] [--source jpeg-pleno=FOLDER]
        [--source nerf=FOLDER] [--source dfv=FOLDER] [--source basic-lfsr=FOLDER]
        [--source epinet=FOLDER] [--out benchmarks/published/interop.csv]

Each package is installed into an environment of its own under ``--work``; for a program without a
package, ``--source`` names a checkout of its repository.  A reader that is not available is named,
and its row in the result file stays.  None of their code is kept here.
"""

import argparse
import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from benchmarks.interop import data_sets
from benchmarks.results import update_result
from lfcore.datasets.items import stored_items
from lfcore.exchange.exporting import export_lightfield
from lfcore.exchange.grid import Geometry, ViewGrid
from lfcore.exchange.importing import store_grid
from lfcore.lightfield import LightField
from lfcore.storage.codecs import Encoding

READERS = Path(__file__).parent / "readers"
SIDE, WIDTH, HEIGHT = 5, 48, 40
GEOMETRY = Geometry(pitch_m=0.01, pixel_pitch=0.02, delta=0.5, sensor_m=0.036)
DEPTH_M = (1.0, 4.0)
FORMATS = ("hci", "json", "stanford", "eslf", "mosaic", "mat", "jpeg-pleno", "nerfstudio", "llff",
           "colmap")  # fmt: skip
POINTS = np.array([[0.05, -0.04, 1.3], [-0.2, 0.1, 2.0], [0.3, 0.2, 3.7]])
"""Points in camera space, x right, y down, metres, which readers of poses project."""


class Missing(Exception):
    """The reader is not available."""


@dataclass
class Bench:
    """The input of readers: folders of exports by format, and the truth."""

    work: Path
    sources: dict[str, Path]
    views: np.ndarray
    field: LightField

    def export(self, name: str) -> Path:
        return self.work / "exports" / name

    def file(self, name: str) -> Path:
        """The one file of an export."""
        return next(self.export(name).iterdir())

    def environment(self, name: str, packages: list[str], extra: list[str] | None = None) -> Path:
        """The Python of an environment with these packages, made once."""
        folder = self.work / name
        python = folder / "bin" / "python"
        if not python.exists():
            run([sys.executable, "-m", "venv", str(folder)])
        if not (folder / "installed").exists():
            run([str(python), "-m", "pip", "install", "-q", *packages])
            if extra:
                run([str(python), "-m", "pip", "install", "-q", "--no-deps", *extra])
            (folder / "installed").touch()
        return python

    def source(self, name: str) -> Path:
        if name not in self.sources:
            raise Missing(f"no --source {name}=FOLDER")
        return self.sources[name].resolve()

    def read(self, python: Path | str, script: str, *words: object) -> dict[str, np.ndarray]:
        """Run a reader's script, which writes what it read to one npz file."""
        out = self.work / f"{Path(script).stem}.npz"
        out.unlink(missing_ok=True)
        run([str(python), str(READERS / script), *map(str, words), str(out)])
        with np.load(out, allow_pickle=False) as data:
            return dict(data)

    def read_points(self, python: Path, script: str, *words: object) -> dict[str, np.ndarray]:
        """As :meth:`read`, of a reader of poses: ``pixels`` is (rows, columns, points, 2)."""
        made = self.read(python, script, *words, json.dumps(POINTS.tolist()))
        return made | {"pixels": made["pixels"].reshape(SIDE, SIDE, len(POINTS), 2)}

    def pixels_about_axis(self, delta: float) -> np.ndarray:
        """(rows, columns, points, 2): places of the points in pixels, from the axis of each view
        that is sheared by ``delta``."""
        slab = self.field.require_slab()
        column, row, columns, rows = slab.held.views
        place = slab.lens_positions()
        x, y = place[column : column + columns], place[row : row + rows]
        at = np.stack(np.meshgrid(x, y), -1)[:, :, None]
        return ((POINTS[:, :2] - at) / POINTS[:, 2:] + at * delta) / slab.pixel_pitch

    def projected(self) -> np.ndarray:
        """(rows, columns, points, 2): the points' pixel coordinates, from the corner."""
        slab = self.field.require_slab()
        corner = slab.pixels / 2 - np.array(slab.held.pixels[:2])
        return self.pixels_about_axis(slab.camera.delta) + corner


def run(command: list[str], timeout: float = 900, **more) -> str:
    done = subprocess.run(command, capture_output=True, text=True, timeout=timeout, **more)
    if done.returncode:
        lines = (done.stderr or done.stdout).strip().splitlines() or ["no output"]
        raise RuntimeError(lines[-1][:200])
    return done.stdout


def same(found: np.ndarray, expected: np.ndarray, what: str) -> str:
    np.testing.assert_array_equal(found, expected, what)
    return what


def near(found: np.ndarray, expected: np.ndarray, limit: float, what: str) -> str:
    np.testing.assert_allclose(found, expected, 0, limit, err_msg=what)
    return f"{what} to {np.abs(found - expected).max():.1g}"


def plenpy(bench: Bench) -> list[str]:
    python = bench.environment("plenpy", ["plenpy==0.9.2"])
    files = map(bench.file, ("mosaic", "eslf", "mat"))
    made = bench.read(python, "plenpy_reader.py", bench.export("json"), *files, SIDE, HEIGHT, WIDTH)
    names = {"folder": "json: views", "sai": "mosaic", "mli": "eslf", "mat": "mat"}
    return [same(made[key], bench.views, what) for key, what in names.items()]


def plenopticam(bench: Bench) -> list[str]:
    # Not its own pins, some of which have no wheels: SciPy is the last that has scipy.misc.face.
    needs = ["numpy<2", "scipy<1.11", "pillow", "imageio", "tifffile", "scikit-image<0.23",
             "matplotlib", "requests", "docutils", "colour_demosaicing<0.2.6",
             "color_space_converter", "color_matcher", "ddt"]  # fmt: skip
    python = bench.environment("plenopticam", needs, ["plenopticam==0.9.3", "depthy"])
    white = next(bench.export("plenoptic").glob("*_white.png"))
    words = bench.file("eslf"), bench.export("json"), SIDE, white
    made = bench.read(python, "plenopticam_reader.py", *words)
    centres = made["centres"]
    ours = np.array(json.loads(white.with_suffix(".json").read_text())["mic_list"])
    order = np.lexsort((np.rint(centres[:, 1]), np.rint(centres[:, 0])))
    return [
        same(made["rearranged"], bench.views, "eslf: rearranged"),
        same(made["single"], bench.views[2, 2], "json: a view"),
        near(centres[order, :2], ours[:, :2], 0.5, f"{len(ours)} centres of a white image, pixels"),
    ]


def nerfstudio(bench: Bench) -> list[str]:
    python = bench.environment("nerfstudio", ["nerfstudio==1.1.5"])
    made = bench.read_points(python, "nerfstudio_reader.py", bench.export("nerfstudio"))
    return [near(made["pixels"], bench.projected(), 1e-3, "projected points, pixels")]


def colmap(bench: Bench) -> list[str]:
    python = bench.environment("pycolmap", ["pycolmap", "numpy"])
    made = bench.read_points(python, "colmap_reader.py", bench.export("colmap") / "sparse" / "0")
    return [near(made["pixels"], bench.projected(), 1e-6, "projected points, pixels")]


def llff(bench: Bench) -> list[str]:
    python = bench.environment("llff", ["numpy", "imageio", "pillow"])
    made = bench.read_points(python, "llff_reader.py", bench.source("nerf"), bench.export("llff"))
    # Views were cropped about their axes to the whole pixel: half of one at the most.
    expected = bench.pixels_about_axis(delta=0) + made["size"] / 2
    return [near(made["pixels"], expected, 1e-6, "projected points, pixels"),
            near(made["bounds"], np.array([DEPTH_M] * SIDE**2), 1e-9, "bounds")]  # fmt: skip


def hci_tools(bench: Bench) -> list[str]:
    python = bench.environment("hci-tools", ["numpy", "imageio", "pillow"])
    read = partial(bench.read, python, "hci_reader.py", bench.source("hci-tools"))
    made = read(bench.export("hci"))
    folder = data_sets.made(bench.work, "whole", data_sets.WHOLE)
    item, (views, disparity) = read(folder / "data/hci/train/000000"), data_sets.field_of(folder)
    slab = bench.field.require_slab()
    ends = (1 / np.array(DEPTH_M[::-1]) - slab.camera.delta) * slab.lens_pitch_m
    return [
        same(made["views"], bench.views, "views"),
        near(made["numbers"], np.array([WIDTH, HEIGHT, SIDE, SIDE, 10.0, 2.0]), 1e-9, "geometry"),
        near(made["range"], ends / slab.pixel_pitch, 1e-6, "range of disparity"),
        same(item["views"], views, "a data set's views"),
        same(item["disparity"], disparity, "and disparity, as in HDF5"),
    ]


def epinet(bench: Bench) -> list[str]:
    folder = data_sets.made(bench.work, "whole", data_sets.WHOLE)
    python = bench.environment("data-sets", data_sets.PACKAGES)
    data = folder / "data/hci/train"
    made = bench.read(python, "epinet_reader.py", bench.source("epinet"), data)
    views, disparity = data_sets.field_of(folder)
    return [
        same(made["views"], views, "views"),
        same(made["disparity"], disparity, "disparity"),
        same(made["inputs"], np.array([4, 512, 512, 9]), "four stacks of views"),
        near(made["apart"], np.zeros(()), 1e-5, "equal for training and test"),
    ]


def lftoolbox(bench: Bench) -> list[str]:
    out = bench.work / "lftoolbox.mat"
    out.unlink(missing_ok=True)
    if not shutil.which("octave-cli"):
        raise Missing("no octave-cli")
    run(["octave-cli", "--no-gui", str(READERS / "lftoolbox_reader.m"),
         str(bench.source("lftoolbox")), str(bench.export("stanford")), str(bench.file("eslf")),
         str(bench.file("mat")), str(SIDE), str(out)])  # fmt: skip
    from scipy.io import loadmat

    made = loadmat(out)
    return [
        same(made["gantry"], bench.views, "stanford: LFReadGantryArray"),
        same(made["eslf"], bench.views, "eslf: LFReadESLF"),
        same(made["stored"], bench.views, "mat: load"),
    ]


def jpeg_pleno(bench: Bench) -> list[str]:
    source, program = bench.source("jpeg-pleno"), bench.work / "jpeg_pleno_reader"
    if not program.exists():
        library = source / "source" / "Lib"
        images = sorted((library / "Utils" / "Image").glob("*.cpp"))
        images.append(library / "Utils" / "Stream" / "BinaryTools.cpp")
        images += sorted((library / "Part2" / "Common").glob("*ViewToFilename*.cpp"))
        # Two of its files define one function alike; its own build links them apart.
        flags = ["-std=c++17", "-O1", "-w", "-Wl,-z,muldefs", "-I", str(source / "source")]
        reader = str(READERS / "jpeg_pleno_reader.cpp")
        run(["g++", *flags, "-o", str(program), reader, *map(str, images)])
    out = bench.work / "jpeg_pleno.raw"
    run([str(program), str(bench.export("jpeg-pleno")), str(SIDE), str(SIDE), str(out)])
    found = np.fromfile(out, np.uint16).reshape(SIDE, SIDE, HEIGHT, WIDTH, 3)
    expected = np.rint(bench.views * (1023 / 255)).astype(np.uint16)
    return [same(found, expected, "views, 10 bits")]


def dfv(bench: Bench) -> list[str]:
    folder = data_sets.made(bench.work, "stacks", data_sets.STACKS)
    python = bench.environment("data-sets", data_sets.PACKAGES)
    made = bench.read(python, "dfv_reader.py", bench.source("dfv"), f"{folder}/data/")
    (item,) = stored_items([folder / "shard.tar"], [0])
    stack = [item.codes(name) for name in sorted(item.pictures()) if name.startswith("focus")]
    return [
        same(made["stack"], np.stack(stack), "a stack"),
        same(made["depth"], item.floats("depth.exr"), "its depth"),
        same(made["batch"], np.array([2, 5, 3, 256, 256]), "a batch's shape"),
    ]


def basic_lfsr(bench: Bench) -> list[str]:
    folder = data_sets.made(bench.work, "fields", data_sets.FIELDS)
    python = bench.environment("data-sets", data_sets.PACKAGES)
    words = bench.source("basic-lfsr"), f"{folder}/data/", bench.work / "lfsr"
    made = bench.read(python, "lfsr_reader.py", *words)
    side = 5 * 64
    return [
        same(made["high"], np.array([1, side, side]), "patches of 5 x 5 views of 64 pixels"),
        same(made["low"], np.array([1, side // 2, side // 2]), "half as fine"),
        same(made["count"], np.array(4), "four of them"),
    ]


def training_tools(bench: Bench) -> list[str]:
    folder = data_sets.made(bench.work, "stacks", data_sets.STACKS)
    python = bench.environment("data-sets", data_sets.PACKAGES)
    card = folder / "croissant.json"
    made = bench.read(python, "webdataset_reader.py", folder / "shard.tar", card)
    names = [name for name in made["names"].tolist() if not name.startswith("_")]
    (item,) = stored_items([folder / "shard.tar"], [0])
    return [
        same(made["keys"], np.array(["000000", "000001"]), "webdataset: samples"),
        same(np.array(names), np.array(sorted(item.files)), "their fields"),
        near(np.minimum(made["db"], 30), np.full(2, 30.0), 0, "mlcroissant: items of 30 dB"),
    ]


PEERS: dict[str, tuple[str, Callable[[Bench], list[str]]]] = {
    "plenpy": ("plenpy 0.9.2", plenpy),
    "plenopticam": ("PlenoptiCam 0.9.3", plenopticam),
    "nerfstudio": ("nerfstudio 1.1.5, its dataparser", nerfstudio),
    "colmap": ("COLMAP, pycolmap", colmap),
    "llff": ("NeRF's LLFF loader", llff),
    "hci-tools": ("HCI python-tools, by 2to3", hci_tools),
    "lftoolbox": ("LFToolbox in Octave", lftoolbox),
    "jpeg-pleno": ("JPEG Pleno's PPM reader", jpeg_pleno),
    "dfv": ("DFV's loader of FoD500", dfv),
    "epinet": ("EPINET's loader", epinet),
    "basic-lfsr": ("BasicLFSR's script and loader", basic_lfsr),
    "training-tools": ("webdataset, mlcroissant", training_tools),
}


def prepare(work: Path, sources: dict[str, Path]) -> Bench:
    """A light field of smooth noise, and its exports."""
    work.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(7)
    views = rng.integers(0, 256, (SIDE, SIDE, HEIGHT, WIDTH, 3), dtype=np.uint8)
    grid = ViewGrid.of_array(views, "noise", format="test", geometry=GEOMETRY, depth_m=DEPTH_M)
    path = work / "noise.mkv"
    spec = Encoding("ffv1", "gbrp", preset=None, tune=None)
    store_grid(path, grid, spec)
    bench = Bench(work, sources, views, LightField.open(path))

    def export(source: Path, name: str) -> None:
        shutil.rmtree(bench.export(name), ignore_errors=True)
        export_lightfield(source, name, bench.export(name))

    for name in FORMATS:
        export(path, name)
    many = rng.integers(0, 256, (15, 15, 30, 40, 3), dtype=np.uint8)
    store_grid(work / "many.mkv", ViewGrid.of_array(many, "many"), spec)
    export(work / "many.mkv", "plenoptic")
    return bench


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--only", default=",".join(PEERS))
    parser.add_argument("--source", action="append", default=[], metavar="NAME=FOLDER")
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    pairs = dict(text.split("=", 1) for text in arguments.source)
    bench = prepare(arguments.work.resolve(), {name: Path(path) for name, path in pairs.items()})
    rows = []
    for name in arguments.only.split(","):
        title, check = PEERS[name]
        try:
            said = "; ".join(check(bench))
        except Missing as reason:
            print(f"{title}: not run, {reason}", flush=True)
            continue
        except (AssertionError, RuntimeError, subprocess.TimeoutExpired) as error:
            said = f"FAILS: {' '.join(str(error).split())[:200]}"
        print(f"{title}: {said}", flush=True)
        rows.append({"reader": title, "compared": said})
    if arguments.out:
        update_result(arguments.out, "python -m benchmarks.interop.run", rows, "reader")


if __name__ == "__main__":
    main()
