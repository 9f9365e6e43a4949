"""Picture files, read and written in one place.

PNG, PPM, JPEG and their like hold 8-bit sRGB codes to look at; EXR, PFM and NPY hold linear light.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np

from lfcore.colour import check_exposure, exposed, srgb_codes, srgb_decode
from lfcore.errors import LfcoreError
from lfcore.files import make_folder, whole_file
from lfcore.reading import LARGEST_PICTURE, opened, read_bytes

if TYPE_CHECKING:
    from PIL import Image

LIGHT_FIELD = ".mkv"
CODED = (".png", ".ppm", ".jpg", ".jpeg", ".webp")
SUFFIXES = (*CODED, ".exr", ".npy")
"""What the command line offers."""
ALL_CODED = (*CODED, ".bmp", ".tif", ".tiff")
DEEP = (".png", ".tif", ".tiff")
"""Formats of 16-bit codes, too."""
ALL_SUFFIXES = (*ALL_CODED, ".exr", ".npy", ".pfm")
UNKNOWN = "of no known format"
EXR_MAGIC = b"\x76\x2f\x31\x01"
PPM_HEADER = re.compile(rb"P6%b(\d{1,9})%b(\d{1,9})%b(\d{1,9})\s" % ((rb"(?:\s|#[^\n]*\n)+",) * 3))
PILLOWS = "PNG", "JPEG", "WEBP", "GIF", "BMP", "DIB", "TGA", "TIFF", "PPM", "SGI"
"""The formats that Pillow may open: of EPS, which any name may hide, it starts Ghostscript."""
MOST_PIXELS = 1 << 30  # mosaics of views are large by nature
_PNG_COMPRESSION = 3  # of 9: a third more bytes than the most, in a tenth of the time


def check_suffix(
    path: str | Path, suffixes: Sequence[str] = SUFFIXES, key: str | None = "path"
) -> None:
    """Raise :class:`LfcoreError` for a name of no known format, before any work is done."""
    suffix = Path(path).suffix
    if suffix.lower() not in suffixes:
        problem = f"unknown format {suffix!r}"
        remedy = f"Use a name that ends in {', '.join(suffixes)}"
        if suffix.lower() == LIGHT_FIELD:
            problem = "is the name of a light field, which record writes"
        raise LfcoreError(problem, file=path, key=key, remedy=remedy)


def check_codes(path: str | Path, bits: int, exposure: bool) -> None:
    """Raise :class:`LfcoreError` for more than 8 bits of a format that has not so many, and for an
    exposure of one that holds all light."""
    if exposure and Path(path).suffix.lower() not in ALL_CODED:
        raise LfcoreError(
            "holds all light", file=path, key="exposure_ev", remedy="Leave it out, or write a .png"
        )
    if bits not in (8, 16):
        raise LfcoreError(f"must be 8 or 16, not {bits!r}", key="bits")
    if bits != 8 and Path(path).suffix.lower() not in DEEP:
        problem = f"has no codes of {bits} bits"
        raise LfcoreError(problem, file=path, key="bits", remedy="Write a .png")


def write_picture(
    path: str | Path,
    picture: np.ndarray,
    *,
    half: bool = False,
    bits: int = 8,
    exposure_ev: float = 0.0,
    roll_off: bool = False,
) -> None:
    """Write one picture; the suffix of the name is the format.

    Parameters
    ----------
    path : str or Path
        The file; it appears when it is whole.
    picture : ndarray
        (H, W, 3), also (H, W) except in EXR; any array to ``.npy``.  Floats are linear light, uint8
        and uint16 sRGB codes.
    half : bool
        Write 16-bit floats in EXR.
    bits : int
        8, or 16 in PNG and TIFF: of the codes of linear light.
    exposure_ev, roll_off : float, bool
        As in :func:`exposed`, before linear light becomes codes; EXR, PFM and NPY keep all light.

    Raises
    ------
    LfcoreError
        A name of no known format, or a file that cannot be written; none is left.

    Examples
    --------
    >>> lfcore.write_picture("ball.png", lfcore.render(scene, pixels=16, views=2), exposure_ev=1)
    """
    named = [(path, picture)]
    write_pictures(named, half=half, bits=bits, exposure_ev=exposure_ev, roll_off=roll_off)


def write_pictures(
    named: Sequence[tuple[str | Path, np.ndarray]],
    *,
    half: bool = False,
    bits: int = 8,
    exposure_ev: float = 0.0,
    roll_off: bool = False,
) -> None:
    """As :func:`write_picture`, several; all of them appear, or none."""
    check_exposure(exposure_ev)
    with ExitStack() as stack:
        files = []
        for path, picture in named:
            check_suffix(path, ALL_SUFFIXES, key=None)
            check_codes(path, bits, exposure=False)
            make_folder(Path(path).parent)
            file = stack.enter_context(whole_file(path))
            picture = np.asarray(picture)
            suffix = Path(path).suffix.lower()
            if suffix in ALL_CODED and picture.dtype.kind == "f" and (exposure_ev or roll_off):
                picture = exposed(picture, exposure_ev, roll_off)
            if suffix == ".npy":
                np.save(file, picture, allow_pickle=False)
            else:
                try:
                    file.write(picture_bytes(suffix, picture, half=half, bits=bits))
                except LfcoreError as error:
                    raise error.named(type(error), file=error.file or path) from None
            files.append(file)
        for file in files:
            file.sync()


def picture_bytes(suffix: str, picture: np.ndarray, *, half: bool = False, bits: int = 8) -> bytes:
    """The file that :func:`write_picture` writes by a name with this suffix, ``.npy`` apart."""
    coloured = picture.shape[2:] == (3,)
    is_codes = picture.dtype in (np.uint8, np.uint16)
    if not (picture.ndim == 2 or coloured) or not (picture.dtype.kind == "f" or is_codes):
        problem = f"{picture.dtype} of shape {picture.shape} is no picture"
        remedy = "Give (H, W, 3) floats of linear light, or uint8 or uint16 of sRGB codes"
        raise LfcoreError(problem, remedy=remedy)
    if suffix == ".exr":
        from lfcore.exr import exr_bytes

        return exr_bytes(linear_light(picture), half=half)
    if suffix == ".pfm":
        return _by_opencv(suffix, linear_light(picture).astype(np.float32))
    return _by_opencv(suffix, picture if is_codes else srgb_codes(picture, bits))


def _by_opencv(suffix: str, picture: np.ndarray) -> bytes:
    import cv2  # heavy: whoever writes no such picture does without

    options = [cv2.IMWRITE_PNG_COMPRESSION, _PNG_COMPRESSION] if suffix == ".png" else []
    try:
        if picture.ndim == 3:
            picture = cv2.cvtColor(picture, cv2.COLOR_RGB2BGR)
        done, data = cv2.imencode(suffix, np.ascontiguousarray(picture), options)
    except cv2.error:
        done = False
    if not done:
        raise LfcoreError(f"{picture.dtype} of shape {picture.shape} cannot be written as {suffix}")
    return data.tobytes()


def contact_sheet(
    pictures: np.ndarray, columns: int, gap_px: int = 0, labels: Sequence[str] = ()
) -> np.ndarray:
    """(H, W, 3) of pictures (P, height, width, 3) in rows of ``columns``, with white gaps.

    With ``labels``, one per picture, each picture is above its label.
    """
    if labels and len(labels) != len(pictures):
        raise ValueError(f"{len(pictures)} pictures and {len(labels)} labels make no sheet")
    count, height, width = pictures.shape[:3]
    strips = _label_strips(labels, width)
    high = height + strips.shape[1]
    rows, down, across = -(-count // columns), high + gap_px, width + gap_px
    paper = 255 if pictures.dtype == np.uint8 else 1
    size = rows * down - gap_px, min(columns, count) * across - gap_px, 3
    sheet = np.full(size, paper, pictures.dtype)
    for k, picture in enumerate(pictures):
        y, x = k // columns * down, k % columns * across
        sheet[y : y + height, x : x + width] = picture
        if labels:
            sheet[y + height : y + high, x : x + width] = (strips[k] / (255 // paper))[..., None]
    return sheet


def _label_strips(labels: Sequence[str], width: int) -> np.ndarray:
    """(labels, height, width) uint8: black words on white, as large as fits, to 15 pixels."""
    if not labels:
        return np.zeros((0, 0, width), np.uint8)
    from PIL import Image, ImageDraw, ImageFont

    size = next(
        (size for size in range(15, 6, -1)
         if all(ImageFont.load_default(size).getlength(label) <= width for label in labels)), 6,
    )  # fmt: skip
    strips = []
    for label in labels:
        strip = Image.new("L", (width, size + 8), 255)
        middle = width / 2, (size + 8) / 2
        ImageDraw.Draw(strip).text(middle, label, 0, ImageFont.load_default(size), anchor="mm")
        strips.append(np.asarray(strip))
    return np.stack(strips)


def read_picture(path: str | Path) -> np.ndarray:
    """(H, W, 3) of a picture file: sRGB codes, uint8 or uint16, or linear light, float32.

    As :func:`decode`; :class:`LfcoreError` names the file.
    """
    try:
        return decode(read_bytes(path, LARGEST_PICTURE, "picture"))
    except LfcoreError as error:
        raise error.named(LfcoreError, file=path) from None


def decode(data: bytes, *, alpha: bool = False) -> np.ndarray:
    """(H, W, 3) of the bytes of a picture file: sRGB codes, uint8 or uint16, or linear light.

    The first bytes decide the format, not the name.  EXR, Radiance, PFM and floats in TIFF are
    linear light, float32; an EXR has its display window, a Radiance file its exposure undone.
    Grey is repeated, and palettes are looked up.  With ``alpha`` there is a fourth channel, linear
    and opaque where the file has none; otherwise transparency is dropped.
    """
    if data.startswith(EXR_MAGIC):
        from lfcore.exr import read_exr_picture

        return _with_channels(read_exr_picture(io.BytesIO(data)), alpha)
    if data.startswith(b"#?"):
        return _with_channels(_radiance(data), alpha)
    if (head := PPM_HEADER.match(data)) and head[3] != b"255":
        return _with_channels(_ppm(data, head), alpha)
    # Pillow refuses pictures that are cut short, where OpenCV fills them up; OpenCV knows colours
    # of 16 bits, and of floats.
    picture, reason = _by_pillow(data, alpha)
    deep = data[24:25] == b"\x10" if data[:4] == b"\x89PNG" else data[:2] in (b"II", b"MM")
    if (deep and picture is not None and picture.dtype == np.uint8) or reason == UNKNOWN:
        found = by_opencv(data)
        if found is not None and (picture is None or found.dtype in (np.uint16, np.float32)):
            picture = found
    if picture is None:
        problem = f"cannot be decoded as a picture: {reason}"
        raise LfcoreError(problem, remedy="Use a PNG or JPEG")
    return _with_channels(picture, alpha)


def _with_channels(picture: np.ndarray, alpha: bool) -> np.ndarray:
    """(H, W, 3), or 4 with ``alpha``, of grey, colours, or colours with alpha."""
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, -1)
    if alpha and picture.shape[2] == 3:
        opaque = 1 if picture.dtype.kind == "f" else np.iinfo(picture.dtype).max
        return np.dstack([picture, np.full(picture.shape[:2], opaque, picture.dtype)])
    return np.ascontiguousarray(picture[..., : 4 if alpha else 3])


def picture_size(file: str | Path | io.BytesIO) -> tuple[int, int]:
    """(width, height) by a picture's header, as :func:`decode` returns it.

    Raises :class:`LfcoreError` for what has none.
    """
    name = None if isinstance(file, io.BytesIO) else file
    try:
        with (
            io.BytesIO(file.getvalue())
            if isinstance(file, io.BytesIO)
            else opened(file, "picture") as f
        ):
            head = f.read(1 << 16)
            if head.startswith(EXR_MAGIC):
                from lfcore.exr import exr_size

                return exr_size(file)
            if head.startswith(b"#?"):
                return _radiance_head(head)[:2]
            f.seek(0)
            with open_image(f) as image:
                return image.size
    except LfcoreError as error:
        raise error.named(LfcoreError, file=name) from None
    except Exception as error:  # Pillow raises many kinds on damaged pictures
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())[:120]
        raise LfcoreError(f"cannot be read as a picture: {reason}", file=name) from None


def codes_of(picture: np.ndarray) -> np.ndarray:
    """uint8 sRGB codes of a picture as :func:`decode` returns it; light above 1 is 255."""
    if picture.dtype == np.uint8:
        return picture
    if picture.dtype == np.uint16:
        return ((picture.astype(np.uint32) + 128) // 257).astype(np.uint8)
    codes = srgb_codes(picture)
    codes[..., 3:] = np.rint(255 * np.clip(picture[..., 3:], 0, 1))
    return codes


def linear_light(picture: np.ndarray) -> np.ndarray:
    """Linear light of codes, which integers are; floats are linear light."""
    if picture.dtype == np.uint16:
        return srgb_decode(picture / np.float32(65535))
    return srgb_decode(picture) if picture.dtype == np.uint8 else picture


def open_image(file: BinaryIO) -> Image.Image:
    """A Pillow image of one of :data:`PILLOWS`; raises what Pillow raises."""
    from PIL import Image

    Image.MAX_IMAGE_PIXELS = MOST_PIXELS
    return Image.open(file, formats=PILLOWS)


def _by_pillow(data: bytes, alpha: bool) -> tuple[np.ndarray | None, str]:
    """(H, W) uint16 or float32, or (H, W, 3 or 4) uint8; None and why not."""
    from PIL import UnidentifiedImageError

    try:
        with open_image(io.BytesIO(data)) as image:
            if image.mode == "F":
                return np.array(image, np.float32), ""
            if not image.mode.startswith("I"):
                wide = alpha or image.mode == "P"  # whose transparency Pillow drops with a warning
                return np.array(image.convert("RGBA" if wide else "RGB"), np.uint8), ""
            whole = np.array(image)
            if whole.min(initial=0) < 0 or whole.max(initial=0) > 65535:
                return None, "it has integers of 32 bits"
            return whole.astype(np.uint16), ""
    except UnidentifiedImageError:
        return None, UNKNOWN
    except Exception as error:  # Pillow raises many kinds on damaged pictures
        return None, " ".join(str(error).split())[:120] or type(error).__name__


def by_opencv(data: bytes) -> np.ndarray | None:
    """(H, W, 3 or 4) RGB(A) or (H, W) of a picture's bytes, in its own type; None of others."""
    import cv2

    cv2.utils.logging.setLogLevel(0)  # else it prints why it cannot read
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    if picture is None or picture.ndim == 2:
        return picture
    return np.ascontiguousarray(picture[..., [2, 1, 0, 3][: picture.shape[2]]])


def _ppm(data: bytes, head: re.Match[bytes]) -> np.ndarray:
    """(H, W, 3) of a binary PPM: uint8, or uint16 scaled to the full range of 16 bits."""
    width, height, most = (int(word) for word in head.groups())
    if not (0 < most < 65536 and width > 0 and height > 0):
        raise LfcoreError("is no binary PPM (P6) of 1 to 16 bits")
    item = np.dtype(np.uint8) if most < 256 else np.dtype(">u2")
    whole = head.end() + width * height * 3 * item.itemsize
    if len(data) < whole:
        raise LfcoreError(f"is cut short: {len(data)} bytes, {whole} expected")
    codes: np.ndarray = np.frombuffer(data, item, width * height * 3, head.end())
    scaled = np.rint(codes.reshape(height, width, 3) * (65535.0 / most))
    return scaled.clip(0, 65535).astype(np.uint16)


def _radiance(data: bytes) -> np.ndarray:
    """(H, W, 3) float32 radiance of a Radiance file.

    Its numbers are divided by every EXPOSURE and COLORCORR of the header (G. Ward, "The RADIANCE
    Picture File Format").  OpenCV reads neither, nor every header, so that it is given a plain one.
    """
    width, height, factor, rest = _radiance_head(data)
    plain = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %d +X %d\n" % (height, width)
    picture = by_opencv(plain + data[rest:])
    if picture is None:
        raise LfcoreError("cannot be decoded as a picture: it is damaged")
    return picture if (factor == 1).all() else (picture / factor).astype(np.float32)


def _radiance_head(data: bytes) -> tuple[int, int, np.ndarray, int]:
    """Width, height, (3,) what light was multiplied by, and where the pixels begin."""
    found = re.search(rb"\n\n([-+][XY]) (\d{1,9}) ([-+][XY]) (\d{1,9})\n", data[: 1 << 16])
    if not found:
        raise LfcoreError("is no Radiance HDR")
    head = data[: found.start() + 1]
    if (found[1], found[3]) != (b"-Y", b"+X") or b"\nFORMAT=32-bit_rle_xyze" in head:
        problem = "has rows or columns that run the other way, or XYZ colours"
        raise LfcoreError(problem, remedy="Save it as RGB, from top left, or as EXR")
    factor = np.ones(3)
    try:
        for value in re.findall(rb"\n(?:EXPOSURE|COLORCORR)=([^\n]*)", head):
            factor = factor * np.array(value.split(), float)
    except ValueError:
        factor = np.zeros(3)
    if not (np.isfinite(factor).all() and factor.min() > 0):
        raise LfcoreError("has an EXPOSURE or COLORCORR that is no positive number")
    return int(found[4]), int(found[2]), factor, found.end()
