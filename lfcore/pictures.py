"""Picture files, read and written in one place.

PNG, PPM, JPEG and their like hold 8-bit sRGB codes to look at; EXR, PFM and NPY hold linear light.
"""

import io
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import numpy as np

from lfcore.colour import check_exposure, exposed, srgb_codes, srgb_decode
from lfcore.errors import LfcoreError
from lfcore.files import make_folder, whole_file

CODED = (".png", ".ppm", ".jpg", ".jpeg", ".webp")
SUFFIXES = (*CODED, ".exr", ".npy")
"""What the command line offers."""
ALL_CODED = (*CODED, ".bmp", ".tif", ".tiff")
DEEP = (".png", ".tif", ".tiff")
"""Formats of 16-bit codes, too."""
ALL_SUFFIXES = (*ALL_CODED, ".exr", ".npy", ".pfm")
UNKNOWN = "of no known format"
MOST_PIXELS = 1 << 30  # mosaics of views are large by nature
_PNG_COMPRESSION = 3  # of 9: a third more bytes than the most, in a tenth of the time


def check_suffix(
    path: str | Path, suffixes: Sequence[str] = SUFFIXES, key: str | None = "--output"
) -> None:
    """Raise :class:`LfcoreError` for a name of no known format, before any work is done."""
    suffix = Path(path).suffix
    if suffix.lower() not in suffixes:
        problem = f"unknown format {suffix!r}"
        remedy = f"Use a name that ends in {', '.join(suffixes)}"
        raise LfcoreError(problem, file=path, key=key, remedy=remedy)


def check_codes(path: str | Path, bits: int, exposure: bool) -> None:
    """Raise :class:`LfcoreError` for more than 8 bits of a format that has not so many, and for an
    exposure of one that holds all light."""
    if exposure and Path(path).suffix.lower() not in ALL_CODED:
        raise LfcoreError(
            "holds all light", file=path, key="--exposure", remedy="Leave it out, or write a .png"
        )
    if bits not in (8, 16):
        raise LfcoreError(f"must be 8 or 16, not {bits!r}", key="bits")
    if bits != 8 and Path(path).suffix.lower() not in DEEP:
        problem = f"has no codes of {bits} bits"
        raise LfcoreError(problem, file=path, key="--bits", remedy="Write a .png")


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

        return exr_bytes(_linear(picture), half=half)
    if suffix == ".pfm":
        return _by_opencv(suffix, _linear(picture).astype(np.float32))
    return _by_opencv(suffix, picture if is_codes else srgb_codes(picture, bits))


def _linear(picture: np.ndarray) -> np.ndarray:
    """Linear light of codes, which integers are; floats are linear light."""
    if picture.dtype == np.uint16:
        return srgb_decode(picture / np.float32(65535))
    return srgb_decode(picture) if picture.dtype == np.uint8 else picture


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


def read_codes(path: str | Path) -> np.ndarray:
    """(H, W, 3) RGB of a picture file: uint8 or uint16 codes, float32 of HDR and the like.

    Transparency is dropped, and grey is repeated.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise LfcoreError(f"cannot be read: {error.strerror or error}", file=path) from None
    # Pillow refuses pictures that are cut short, where OpenCV fills them up; OpenCV knows colours
    # of 16 bits, and of floats.
    picture, reason = _by_pillow(data)
    deep = data[24:25] == b"\x10" if data[:4] == b"\x89PNG" else data[:2] in (b"II", b"MM")
    if deep or (picture is None and reason == UNKNOWN):
        found = by_opencv(data)
        if found is not None and (picture is None or found.dtype == np.uint16):
            picture = found if found.ndim == 3 else np.repeat(found[..., None], 3, -1)
    if picture is None:
        problem = f"cannot be decoded as a picture: {reason}"
        raise LfcoreError(problem, file=path, remedy="Use a PNG or JPEG")
    return picture


def _by_pillow(data: bytes) -> tuple[np.ndarray | None, str]:
    """(H, W, 3) uint8, or None and why."""
    from PIL import Image, UnidentifiedImageError

    Image.MAX_IMAGE_PIXELS = MOST_PIXELS
    try:
        with Image.open(io.BytesIO(data)) as image:
            return np.array(image.convert("RGB"), np.uint8), ""
    except UnidentifiedImageError:
        return None, UNKNOWN
    except Exception as error:  # Pillow raises many kinds on damaged pictures
        return None, " ".join(str(error).split())[:120] or type(error).__name__


def by_opencv(data: bytes) -> np.ndarray | None:
    """(H, W, 3) RGB or (H, W) of a picture file's bytes, in its own type; None for other bytes."""
    import cv2

    cv2.utils.logging.setLogLevel(0)  # else it prints why it cannot read
    try:
        picture = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None
    if picture is None or picture.ndim == 2:
        return picture
    return np.ascontiguousarray(picture[..., 2::-1])
