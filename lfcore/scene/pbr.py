"""Materials of metal and roughness, as trimesh reads them from glTF and other formats."""

from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import SceneError
from lfcore.scene.surface_mesh import Colour, Surface, triple


def surface_of_pbr(material: Any, path: Path, *, metal_left_out: float = 0.0) -> Surface:
    """The surface of one of trimesh's PBRMaterials.

    It is of metal and roughness where the file says anything of either (``metal_left_out`` is the
    metallic factor of roughness alone), else matt: exporters rarely mean glTF's default, a metal.
    """
    metallic, roughness = material.metallicFactor, material.roughnessFactor
    image = material.metallicRoughnessTexture
    given = not (metallic is None and roughness is None and image is None)
    glow = np.zeros(3)
    if material.emissiveFactor is not None:
        glow = np.clip(np.asarray(material.emissiveFactor, np.float64)[:3], 0, 1)
    glows = bool(glow.any())
    return Surface(
        str(material.name or path.stem),
        base_colour(material),
        emission=clipped(glow),
        texture=picture(material.baseColorTexture, path),
        metallic=_share(metallic, metal_left_out, path) if given else -1.0,
        roughness=_share(roughness, 1.0, path),
        metal_texture=picture(image, path),
        normal_texture=picture(material.normalTexture, path),
        emission_texture=picture(material.emissiveTexture, path) if glows else None,
    )


def picture(image: Any, path: Path, mode: str = "RGB") -> np.ndarray | None:
    """(H, W, channels) uint8 of a Pillow image, None of none."""
    if image is None:
        return None
    try:
        return np.array(image.convert(mode), np.uint8)
    except Exception as error:  # Pillow raises many kinds on damaged images
        raise SceneError(
            f"texture cannot be decoded: {error}", file=path, remedy="Replace the image"
        ) from error


def base_colour(material: Any) -> Colour:
    return clipped(factor(material)[:3])


def _share(value: Any, otherwise: float, path: Path) -> float:
    """A factor from 0 to 1; ``otherwise`` where there is none."""
    try:
        return otherwise if value is None else float(np.clip(float(value), 0, 1))
    except (TypeError, ValueError, OverflowError):
        raise SceneError(
            f"a material's factor is {str(value)[:40]!r}", file=path, remedy="Give it from 0 to 1"
        ) from None


def factor(material: Any) -> np.ndarray:
    """(4,) base colour and alpha, which trimesh holds as floats or as whole numbers."""
    given = np.ones(4) if material.baseColorFactor is None else np.asarray(material.baseColorFactor)
    whole = np.issubdtype(given.dtype, np.integer)
    factor = np.ones(4)
    factor[: len(given[:4])] = given[:4] / (float(np.iinfo(given.dtype).max) if whole else 1.0)
    return factor


def clipped(colour: np.ndarray) -> Colour:
    """A colour in [0, 1]."""
    return triple(np.clip(np.asarray(colour, np.float64), 0, 1))
