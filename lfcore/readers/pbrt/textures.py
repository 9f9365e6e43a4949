"""Converts pbrt's textures to the tracer's: a colour times an image with a uv transform."""

import math
import os
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from lfcore.colour import srgb_codes, srgb_decode
from lfcore.errors import LfcoreError
from lfcore.pictures import linear_light, read_picture
from lfcore.readers.pbrt.lexer import Place
from lfcore.readers.pbrt.parameters import COLOUR_TYPES, ParameterSet
from lfcore.readers.pbrt.spectra import parameter_rgb
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT

CHECK_TEXELS = 64
"""The side of a checkerboard's field, texels: bilinear filtering blurs 1 / 64 of its edge."""


@dataclass(frozen=True, eq=False)
class Texture:
    """A colour ``factor`` (linear RGB) times ``image`` at ``uv * uv_scale + uv_offset``.

    ``image`` is (H, W, 3) uint8, sRGB encoded, row 0 on top; None is white.
    """

    factor: np.ndarray
    image: np.ndarray | None = None
    uv_scale: tuple[float, float] = (1.0, 1.0)
    uv_offset: tuple[float, float] = (0.0, 0.0)

    def mean(self) -> np.ndarray:
        """Return the mean linear RGB, (3,)."""
        if self.image is None:
            return self.factor
        return self.factor * srgb_decode(self.image / 255.0).mean((0, 1))


def constant(value: float | np.ndarray) -> Texture:
    return Texture(np.broadcast_to(np.asarray(value, np.float64), (3,)).copy())


def encode(linear: np.ndarray) -> tuple[np.ndarray, float]:
    """Encode linear (H, W, 3) as sRGB uint8; also return the factor for values above one."""
    top = max(1.0, float(linear.max(initial=0.0)))
    return srgb_codes(linear / top), top


def read_image(path: Path, place: Place) -> np.ndarray:
    """Read an image by :func:`lfcore.pictures.read_picture`, (H, W, 3), row 0 on top."""
    if not os.path.isfile(path):
        raise place.error(f"image {str(path)!r} does not exist", "Check the path")
    try:
        return read_picture(path)
    except LfcoreError:
        problem = f"image {str(path)!r} cannot be decoded"
        raise place.error(problem, "Use PNG, EXR or TGA") from None


class TextureTable:
    """The named textures of a scene, created when they are defined."""

    def __init__(self, folder: Path):
        self.folder = folder
        self._named: dict[tuple[bool, str], Texture] = {}

    def define(self, name: str, value_type: str, kind: str, parameters: ParameterSet) -> None:
        """Handle ``Texture "name" "type" "class"``; an unknown class becomes grey, and is noted."""
        if kind == "constant":
            texture = self.colour(parameters, "value", 1.0)
        elif kind in ("imagemap", "scale", "checkerboard"):
            texture = getattr(self, f"_{kind}")(parameters)
        else:
            texture = constant(0.5)
            parameters.note(LEFT_OUT, f'Texture "{name}" of class "{kind}": a grey of 0.5')
        parameters.note_unused()
        self._named[value_type == "float", name] = texture

    def find(self, name: str, place: Place, is_float: bool) -> Texture:
        if (is_float, name) not in self._named:
            raise place.error(f'texture "{name}" is not defined', "Define it before with Texture")
        return self._named[is_float, name]

    def colour(self, parameters: ParameterSet, name: str, default: float | np.ndarray) -> Texture:
        """Return a colour parameter, which may be a texture."""
        parameter = parameters.get(name, "texture", "float", *COLOUR_TYPES)
        if parameter is None:
            return constant(default)
        if parameter.type == "texture":
            name = parameter.values[0]
            return self.find(name, parameter.place, (False, name) not in self._named)
        return Texture(parameter_rgb(parameter, self.folder).astype(np.float64))

    def number(self, parameters: ParameterSet, name: str, default: float) -> float:
        """Return a float parameter; a texture is replaced by its mean, and noted."""
        parameter = parameters.get(name, "texture", "float")
        if parameter is None:
            return default
        if parameter.type == "float":
            return float(parameter.values[0])
        texture = self.find(parameter.values[0], parameter.place, True)
        return float(_mean(texture, parameters, name)[0])

    def rgb(self, parameters: ParameterSet, name: str, default: float | np.ndarray) -> np.ndarray:
        """Return a colour parameter; a texture is replaced by its mean, and noted."""
        return _mean(self.colour(parameters, name, default), parameters, name)

    def _scale(self, parameters: ParameterSet) -> Texture:
        # Version 3 multiplies tex1 by tex2, version 4 tex by scale.
        old = "tex1" in parameters.items or "tex2" in parameters.items
        first, second = ("tex1", "tex2") if old else ("tex", "scale")
        a, b = self.colour(parameters, first, 1.0), self.colour(parameters, second, 1.0)
        if a.image is None:
            return replace(b, factor=a.factor * b.factor)
        if b.image is None:
            return replace(a, factor=a.factor * b.factor)
        if (a.uv_scale, a.uv_offset) != (b.uv_scale, b.uv_offset):
            parameters.approximated("images of different uv mapping, the second as its mean")
            return replace(a, factor=a.factor * b.mean())
        sides = zip(a.image.shape[1::-1], b.image.shape[1::-1], strict=True)
        width, height = map(max, sides)
        first_light, second_light = (
            cv2.resize(srgb_decode(image / 255.0), (width, height), interpolation=cv2.INTER_LINEAR)
            for image in (a.image, b.image)
        )
        image, top = encode(first_light * second_light)
        return replace(a, factor=a.factor * b.factor * top, image=image)

    def _imagemap(self, parameters: ParameterSet) -> Texture:
        name = parameters.string("filename")
        if name is None:
            raise parameters.error("filename", "is missing", "Name the image file")
        place = parameters.items["filename"].place
        picture, factor = read_image(self.folder / name, place), 1.0
        power = _power(parameters)
        if power is not None and picture.dtype.kind == "u":
            picture = (picture / np.iinfo(picture.dtype).max) ** power
        elif picture.dtype == np.uint16:
            picture = linear_light(picture)
        if picture.dtype != np.uint8:
            picture, factor = encode(picture)
        if parameters.bool("invert", False):
            picture, factor = encode(1.0 - srgb_decode(picture / 255.0) * factor)
        if (wrap := parameters.string("wrap", "repeat")) != "repeat":
            parameters.note(APPROXIMATED, f'wrap "{wrap}": repeats instead', "wrap")
        for sampling in ("trilinear", "maxanisotropy", "filter"):
            parameters.get(sampling)
        factor *= parameters.float("scale", 1.0)
        return self._placed(Texture(np.full(3, factor), picture), parameters)

    def _checkerboard(self, parameters: ParameterSet) -> Texture:
        if parameters.integer("dimension", 2) != 2:
            parameters.approximated("3D, drawn in 2D")
        parameters.get("aamode")
        first, second = (
            self.rgb(parameters, name, d) for name, d in (("tex1", 1.0), ("tex2", 0.0))
        )
        fields = np.stack([np.stack([second, first]), np.stack([first, second])])  # row 0 on top
        board = np.repeat(np.repeat(fields, CHECK_TEXELS, 0), CHECK_TEXELS, 1)
        image, top = encode(board)
        # One repeat of the image has two fields per direction.
        return self._placed(Texture(np.full(3, top), image), parameters, period=2.0)

    def _placed(self, texture: Texture, parameters: ParameterSet, period: float = 1.0) -> Texture:
        mapping = parameters.string("mapping", "uv")
        if mapping != "uv":
            parameters.approximated(f'mapping "{mapping}" as "uv"', "mapping")
        u_scale, v_scale = (parameters.float(name, 1.0) / period for name in ("uscale", "vscale"))
        u, v = (parameters.float(name, 0.0) / period for name in ("udelta", "vdelta"))
        return replace(texture, uv_scale=(u_scale, v_scale), uv_offset=(u, v))


def _power(parameters: ParameterSet) -> float | None:
    """Return the exponent from codes of 8 or 16 bits to linear light; None is sRGB's curve."""
    coding = parameters.string("encoding", "sRGB")
    if not parameters.bool("gamma", True) or coding == "linear":
        return 1.0
    kind, _, power = coding.partition(" ")
    try:
        if coding == "sRGB" or (kind == "gamma" and 0 < float(power) < math.inf):
            return None if coding == "sRGB" else float(power)
    except ValueError:
        pass
    problem = f"{coding!r} is none of sRGB, linear, or gamma and a number"
    raise parameters.error("encoding", problem)


def _mean(texture: Texture, parameters: ParameterSet, name: str) -> np.ndarray:
    if texture.image is not None:
        words = f'"{name}" of {parameters.owner}: the mean of its texture'
        parameters.note(APPROXIMATED, words, name)
    return texture.mean()
