"""EXR files, with and without a camera array in the header, textures, and lens files."""

import zlib
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from lfcore.exr import read_exr_picture
from lfcore.optics.array import CameraArray
from lfcore.optics.lens import Lens
from lfcore.optics.lens_system import LensSampler, LensSystem
from lfcore.pictures import write_picture
from lfcore.readers.side_files import read_texture
from lfcore.reading import Where
from lfcore.storage.tiled_exr import read_array, write_array
from robustness.inputs import Inputs, damaged_bytes, damaged_json, damaged_text
from robustness.outcome import ROOT, SilentlyWrong
from robustness.targets import Target, of_file


def exr_seeds(folder: Path) -> list[bytes]:
    ramp = np.linspace(0, 2, 32 * 32 * 3, dtype=np.float32).reshape(32, 32, 3)
    array = CameraArray.on_grid((2, 2), (-1, 1, -1, 1), 40.0, (16, 16))
    write_picture(folder / "plain.exr", ramp)
    write_picture(folder / "half.exr", ramp[:7, :5], half=True)
    write_array(folder / "array.exr", ramp, array, extra={"scene": "ramp"})
    return [(folder / f"{name}.exr").read_bytes() for name in ("plain", "half", "array")]


def check_exr(file: Path) -> None:
    """Check the shape and type; EXR pixels have no check sum."""
    picture = read_exr_picture(file)
    if picture.ndim != 3 or picture.shape[2] != 3 or picture.dtype != np.float32:
        raise SilentlyWrong(f"a picture {picture.shape} {picture.dtype}")
    if not picture.size:
        raise SilentlyWrong("a picture without pixels")
    content = read_array(file)
    if content.array is not None:
        content.array.tiles(content.image)


def damaged_exr(seeds: Sequence[bytes]) -> Inputs:
    """Return seeds with damaged bytes, or a damaged JSON of the geometry, whose length is right."""
    whole = next(seed for seed in seeds if b'{"format"' in seed)
    start = whole.index(b'{"format"')
    length = int.from_bytes(whole[start - 4 : start], "little")
    head, rest = whole[: start - 4], whole[start + length :]

    def with_geometry(text: bytes) -> bytes:
        # The table of offsets becomes wrong; readers repair it.
        return head + len(text).to_bytes(4, "little") + text + rest

    return damaged_bytes(seeds) | damaged_json([whole[start : start + length]]).map(with_geometry)


def texture_seeds(folder: Path) -> list[bytes]:
    codes = np.arange(192, dtype=np.uint8).reshape(8, 8, 3)
    files = []
    for suffix in ("png", "jpg", "tga", "bmp", "gif", "tif", "webp"):
        Image.fromarray(codes).save(folder / f"t.{suffix}")
        files.append((folder / f"t.{suffix}").read_bytes())
    return files


def check_texture(file: Path) -> None:
    texture = read_texture(file, Where("scene.yaml", "texture"))
    if texture.ndim != 3 or texture.shape[2] != 3 or not texture.size:
        raise SilentlyWrong(f"a texture {texture.shape}")


def lens_seeds(folder: Path) -> list[bytes]:
    return [(ROOT / "scenes/lenses/double_gauss.dat").read_bytes(), b"50 5 1.5 20\n-50 40 1 20\n"]


def check_lens(file: Path) -> None:
    """Read and focus a lens, and trace rays; one lens in eight also samples its exit pupil.

    The search for the pupil costs a hundred times as much as the rest.
    """
    lens = LensSystem.read(file).focused(5.0)
    film = np.array([[0.0, 0.0], [0.005, 0.002]])
    rear = np.array([0.001, 0.0, lens.film_distance_m])
    origins = np.pad(film, ((0, 0), (0, 1)))
    arrays = [*lens.trace(origins, rear - origins)]
    if zlib.crc32(file.read_bytes()) % 8 == 0:
        arrays += LensSampler(lens, 0.01).rays(film, np.full((2, 2), 0.4))
        whole = Lens.read(file)
        points, tangents = np.full((3, 2), 1e-3), np.array([[0, 0], [0.1, 0.2], [0.5, -0.4]])
        arrays += whole.landing(points, tangents, 100.0, whole.focal_length_m)
    if not all(np.isfinite(array).all() for array in arrays):
        raise SilentlyWrong("rays that are not finite")


def targets() -> list[Target]:
    lens = of_file("input.dat", check_lens, named=False)
    return [
        Target("exr", exr_seeds, damaged_exr, of_file("input.exr", check_exr)),
        Target("texture", texture_seeds, damaged_bytes, of_file("input.png", check_texture)),
        Target("lens", lens_seeds, damaged_text, lens),
    ]
