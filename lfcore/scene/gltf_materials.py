"""glTF's metallic-roughness materials as Blinn-Phong surfaces; what they lose is noted."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.errors import SceneError
from lfcore.scene.gltf import Document
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT, Notebook
from lfcore.scene.parts import Surface

_DROPPED = {"normalTexture": "bumps", "occlusionTexture": "baked shadows"}
_HANDLED = ("KHR_materials_unlit", "KHR_materials_emissive_strength")
_SOLID = 250
"""Of 255: encoders blur an alpha of one."""


class GltfSurfaces:
    """Surfaces of a document's materials; each is noted once."""

    def __init__(self, document: Document, notebook: Notebook):
        self.document, self.notebook = document, notebook
        self._made: dict[str, Surface | None] = {}

    def surface(self, material: Any, plain: Surface) -> Surface | None:
        """The surface of one of trimesh's PBRMaterials, made of :func:`surface_of_pbr`'s ``plain``.

        None for a cut-out that nothing is left of.
        """
        number = str(material.name)
        if number not in self._made:
            self._made[number] = self._make(material, plain, self.document.material(number))
        return self._made[number]

    def uvs(self, material: Any, uvs: np.ndarray) -> np.ndarray:
        """Texture coordinates (T, 3, 2), v up, as KHR_texture_transform moves the base colour's."""
        textures = self.document.material(str(material.name)).get("pbrMetallicRoughness")
        info = textures.get("baseColorTexture") if isinstance(textures, dict) else None
        change = _extension(info, "KHR_texture_transform")
        if change is None:
            return uvs
        try:
            turn = float(change.get("rotation", 0.0))
            across, down = map(float, change.get("scale", (1, 1)))
            right, below = map(float, change.get("offset", (0, 0)))
        except (TypeError, ValueError) as error:
            raise SceneError(
                f"a texture's transformation makes no sense: {error}", file=self.document.path
            ) from None
        # Counter-clockwise as seen, with glTF's v down: as the reference viewers do.
        c, s = math.cos(turn), math.sin(turn)
        u, v = across * uvs[..., 0], down * (1 - uvs[..., 1])
        return np.stack([c * u + s * v + right, 1 - (c * v - s * u + below)], axis=-1)

    def _make(self, material: Any, plain: Surface, entry: dict) -> Surface | None:
        name = str(entry.get("name") or self.document.path.stem)
        changes: dict[str, Any] = {"name": name}
        cutoff = self._cutoff(material, name)
        if cutoff is None:
            return None
        if cutoff:
            changes["alpha_cutoff"] = cutoff
            changes["texture"] = np.array(material.baseColorTexture.convert("RGBA"), np.uint8)
        for key, what in _DROPPED.items():
            if key in entry:
                self._note(LEFT_OUT, name, what)
        strength = _extension(entry, "KHR_materials_emissive_strength")
        glow = np.array(plain.emission)
        if material.emissiveTexture is not None:
            factor = np.asarray(material.emissiveFactor, np.float64)[:3] if (
                material.emissiveFactor is not None) else np.zeros(3)  # fmt: skip
            glow = factor * srgb_decode(_mean(material.emissiveTexture, self.document.path) / 255.0)
            if glow.any():
                self._note(APPROXIMATED, name, "glows as the mean of its texture")
        if strength is not None:
            glow = glow * float(strength.get("emissiveStrength", 1.0))
        if material.metallicRoughnessTexture is not None:
            self._note(APPROXIMATED, name, "metal and roughness as the means of their texture")
        if _extension(entry, "KHR_materials_unlit") is not None:
            if plain.texture is None:
                glow, changes["diffuse"] = np.array(_base(material)), (0.0, 0.0, 0.0)
            else:
                self._note(APPROXIMATED, name, "unlit, with a texture: lit")
            changes["specular"] = (0.0, 0.0, 0.0)
        for extension in entry.get("extensions") or ():
            if extension.startswith("KHR_materials_") and extension not in _HANDLED:
                self._note(LEFT_OUT, name, extension)
        return Surface(**{**vars(plain), **changes, "emission": tuple(glow.tolist())})

    def _cutoff(self, material: Any, name: str) -> float | None:
        """Where its texture's alpha is below this is a hole; 0: nowhere, None: everywhere.

        Transparency (BLEND) is cut out at a half: a ray then stops or passes by its place on the
        surface alone, so that colours, depths and shadows of all rays agree, which a pattern of
        rays or of places finer than texels would not, and the edges of leaves and of lettering,
        its commonest use, lie where they should.
        """
        mode = material.alphaMode
        if mode not in ("MASK", "BLEND"):
            return 0.0
        alpha, image = float(_factor(material)[3]), material.baseColorTexture
        least, most = (255, 255) if image is None else _alpha_range(image)
        cutoff = 0.5
        if mode == "MASK" and material.alphaCutoff is not None:
            cutoff = float(material.alphaCutoff)
        elif mode == "BLEND" and alpha * least < _SOLID:
            self._note(APPROXIMATED, name, "transparency: cut out where it lets through most")
        if alpha * most / 255 < cutoff:
            self._note(LEFT_OUT, name, "cut out wholly")
            return None
        return cutoff / alpha if alpha * least / 255 < cutoff else 0.0

    def _note(self, kind: str, name: str, what: str) -> None:
        self.notebook.add_in(kind, self.document.path, f"material {name!r}: {what}")


def surface_of_pbr(material: Any, path: Path, texture: np.ndarray | None) -> Surface:
    """glTF metallic-roughness to Blinn-Phong.

    Diffuse keeps the base colour, darkened for metals; the highlight has the reflectance at
    normal incidence, 0.04 or the base colour of a metal, and the exponent 2 / alpha^2 - 2 whose
    lobe matches GGX of alpha = roughness^2 near its peak (Karis 2013).  A metallic factor counts
    only where the file gives one, or a texture: exporters that leave it out rarely mean glTF's
    default of 1.  Textures of metal and roughness count with their means.
    """
    base = np.array(_base(material))
    metallic = _share(material.metallicFactor, 0.0, path)
    roughness = _share(material.roughnessFactor, 1.0, path)
    if material.metallicRoughnessTexture is not None:
        mean = _mean(material.metallicRoughnessTexture, path) / 255.0
        metallic = _share(material.metallicFactor, 1.0, path)
        metallic, roughness = metallic * float(mean[2]), roughness * float(mean[1])
    metallic, roughness = float(np.clip(metallic, 0, 1)), float(np.clip(roughness, 0, 1))
    alpha = max(roughness, 0.05) ** 2
    specular = (0.04 * (1 - metallic) + base * metallic) * (1 - roughness**2)
    emission = np.zeros(3)
    if material.emissiveFactor is not None and material.emissiveTexture is None:
        emission = np.clip(np.asarray(material.emissiveFactor, np.float64)[:3], 0, 1)
    return Surface(
        str(material.name or path.stem),
        _triple(base * (1 - 0.6 * metallic)),
        _triple(specular),
        float(np.clip(2 / alpha**2 - 2, 1, 1000)),
        _triple(emission),
        texture,
    )


def _share(value: Any, otherwise: float, path: Path) -> float:
    """A factor from 0 to 1; ``otherwise`` where there is none."""
    try:
        return otherwise if value is None else float(np.clip(float(value), 0, 1))
    except (TypeError, ValueError, OverflowError):
        raise SceneError(
            f"a material's factor is {str(value)[:40]!r}", file=path, remedy="Give it from 0 to 1"
        ) from None


def _base(material: Any) -> tuple[float, float, float]:
    return _triple(_factor(material)[:3])


def _factor(material: Any) -> np.ndarray:
    """(4,) base colour and alpha, which trimesh holds as floats or as whole numbers."""
    given = np.ones(4) if material.baseColorFactor is None else np.asarray(material.baseColorFactor)
    whole = np.issubdtype(given.dtype, np.integer)
    factor = np.ones(4)
    factor[: len(given[:4])] = given[:4] / (float(np.iinfo(given.dtype).max) if whole else 1.0)
    return factor


def _triple(colour: np.ndarray) -> tuple[float, float, float]:
    red, green, blue = np.clip(np.asarray(colour, np.float64), 0, 1).tolist()
    return red, green, blue


def _mean(image: Any, path: Path) -> np.ndarray:
    """(3,) mean of the codes of a Pillow image."""
    try:
        return np.asarray(image.convert("RGB"), np.float64).mean((0, 1))
    except Exception as error:  # Pillow raises many kinds on damaged images
        raise SceneError(
            f"texture cannot be decoded: {error}", file=path, remedy="Replace the image"
        ) from error


def _alpha_range(image: Any) -> tuple[int, int]:
    """Least and most alpha of a Pillow image, 255 for one without."""
    if "A" not in image.getbands() and "transparency" not in image.info:
        return 255, 255
    least, most = image.convert("RGBA").getchannel("A").getextrema()
    return int(least), int(most)


def _extension(holder: Any, name: str) -> dict | None:
    extensions = holder.get("extensions") if isinstance(holder, dict) else None
    found = extensions.get(name) if isinstance(extensions, dict) else None
    return found if isinstance(found, dict) else None
