"""What glTF says of its materials beside what trimesh reads; what they lose is noted.

Source: Khronos, "glTF 2.0 Specification", sections 3.9 and 5.19, and its extensions.
"""

import math
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.readers.gltf import KNOWN, Document, found
from lfcore.reading import Where
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT, Notebook
from lfcore.scene.surface_mesh import Colour, Surface, triple

_HANDLED = ("KHR_materials_unlit", "KHR_materials_emissive_strength")
_REPEAT = 10497
_SOLID = 250
"""The least code of alpha that is solid: encoders blur an alpha of one."""
_TEXTURES = (
    ("pbrMetallicRoughness", "baseColorTexture"),
    ("pbrMetallicRoughness", "metallicRoughnessTexture"),
    ("normalTexture",),
    ("emissiveTexture",),
)


class GltfSurfaces:
    """Surfaces of a document's materials; each is noted once."""

    def __init__(self, document: Document, notebook: Notebook):
        self.document, self.notebook = document, notebook
        self._made: dict[str, Surface | None] = {}

    def surface(self, material: Any, colours: Any = None) -> Surface | None:
        """The surface of one of trimesh's PBRMaterials, the same one each time.

        ``colours`` are those of vertices, if there are any.  None for what is cut out wholly.
        """
        number = str(material.name)
        entry = self.document.material(number)
        name = str(entry.get("name") or self.document.path.stem)
        if colours is not None:
            self._note_colours(np.asarray(colours), entry, name)
        if number not in self._made:
            self._made[number] = self._make(material, entry, name)
        return self._made[number]

    def uvs(self, material: Any, uvs: np.ndarray) -> np.ndarray:
        """Texture coordinates (T, 3, 2), v up, as KHR_texture_transform moves its textures'."""
        entry = self.document.material(str(material.name))
        name = str(entry.get("name") or self.document.path.stem)
        infos = [info for info in (found(entry, dict, *keys) for keys in _TEXTURES) if info]
        changes = [_extension(info, "KHR_texture_transform") or {} for info in infos]
        for info, change in zip(infos, changes, strict=True):
            if change.get("texCoord", info.get("texCoord", 0)) != 0:
                self._note(APPROXIMATED, name, "other texture coordinates; the first are used")
            if {**change, "texCoord": 0} != {**changes[0], "texCoord": 0}:
                self._note(APPROXIMATED, name, "textures moved one by one; all as one")
        moved = self._moved(uvs, changes[0]) if changes and changes[0] else uvs
        if any(map(self._ends, infos)) and (moved.min(initial=0) < 0 or moved.max(initial=1) > 1):
            self._note(APPROXIMATED, name, "a texture that is clamped or mirrored; it repeats")
        return moved

    def _ends(self, info: dict) -> bool:
        """Whether a texture's sampler does otherwise than repeat it."""
        texture = self.document.entry(info.get("index"), "textures") or {}
        sampler = self.document.entry(texture.get("sampler"), "samplers") or {}
        return any(sampler.get(key, _REPEAT) != _REPEAT for key in ("wrapS", "wrapT"))

    def _moved(self, uvs: np.ndarray, change: dict) -> np.ndarray:
        try:
            turn = float(change.get("rotation", 0.0))
            across, down = map(float, change.get("scale", (1, 1)))
            right, below = map(float, change.get("offset", (0, 0)))
        except (TypeError, ValueError, OverflowError) as error:
            problem = f"a texture's transformation makes no sense: {error}"
            raise Where(self.document.path).error(problem) from None
        # Counter-clockwise as seen, with glTF's v down: as the reference viewers do.
        c, s = math.cos(turn), math.sin(turn)
        u, v = across * uvs[..., 0], down * (1 - uvs[..., 1])
        return np.stack([c * u + s * v + right, 1 - (c * v - s * u + below)], axis=-1)

    def _make(self, material: Any, entry: dict, name: str) -> Surface | None:
        path = self.document.path
        # A metallic factor that is not given is 1, but trimesh leaves it out of what has none.
        generator = str(found(self.document.tree, object, "asset", "generator"))
        metal = 0.0 if "trimesh" in generator else 1.0
        surface = surface_of_pbr(material, path, metal_left_out=metal)
        changes: dict[str, Any] = {"name": name}
        cutoff = self._cutoff(material, name)
        if cutoff is None:
            return None
        if cutoff:
            changes["alpha_cutoff"] = cutoff
            changes["texture"] = picture(material.baseColorTexture, path, "RGBA")
        if "occlusionTexture" in entry:
            self._note(LEFT_OUT, name, "baked shadows")
        if (normal := found(entry, dict, "normalTexture")) is not None:
            changes["normal_scale"] = _number(normal.get("scale", 1.0), path)
        strength = _extension(entry, "KHR_materials_emissive_strength")
        if strength is not None:
            strong = _number(strength.get("emissiveStrength", 1.0), path)
            changes["emission"] = tuple(strong * channel for channel in surface.emission)
        if _extension(entry, "KHR_materials_unlit") is not None:
            changes |= {
                "diffuse": (0.0, 0.0, 0.0), "emission": base_colour(material), "metallic": -1.0,
                "metal_texture": None, "normal_texture": None, "emission_texture": surface.texture,
            }  # fmt: skip
        for extension in entry.get("extensions") or ():
            if extension.startswith("KHR_materials_") and extension not in _HANDLED:
                self._note(APPROXIMATED if extension in KNOWN else LEFT_OUT, name, extension)
        return Surface(**{**vars(surface), **changes})

    def _note_colours(self, colours: np.ndarray, entry: dict, name: str) -> None:
        if _extension(entry, "KHR_materials_unlit") is not None:
            self._note(LEFT_OUT, name, "colours of vertices, which unlit surfaces do not take")
        whole = 1.0 if colours.dtype.kind == "f" else float(np.iinfo(colours.dtype).max)
        transparent = colours.shape[-1] == 4 and colours[..., 3].min(initial=whole) < whole
        if transparent and entry.get("alphaMode") in ("MASK", "BLEND"):
            self._note(LEFT_OUT, name, "alpha of vertices")

    def _cutoff(self, material: Any, name: str) -> float | None:
        """Where its texture's alpha is below this is a hole; 0: nowhere, None: everywhere.

        Transparency (BLEND) is cut out at a half: a ray stops or passes by its place on the surface
        alone, so that colours, depths and shadows of all rays agree.
        """
        mode = material.alphaMode
        if mode not in ("MASK", "BLEND"):
            return 0.0
        alpha, image = float(factor(material)[3]), material.baseColorTexture
        least, most = 255, 255
        if image is not None and ("A" in image.getbands() or "transparency" in image.info):
            least, most = image.convert("RGBA").getchannel("A").getextrema()
        cutoff = 0.5
        if mode == "MASK" and material.alphaCutoff is not None:
            cutoff = float(material.alphaCutoff)
        elif mode == "BLEND" and alpha * least < _SOLID:
            self._note(APPROXIMATED, name, "transparency; cut out where most light passes")
        if alpha * most / 255 < cutoff:
            self._note(LEFT_OUT, name, "cut out wholly")
            return None
        return cutoff / alpha if alpha * least / 255 < cutoff else 0.0

    def _note(self, kind: str, name: str, what: str) -> None:
        self.notebook.add(kind, self.document.path, f"material {name!r}: {what}")


def _extension(holder: Any, name: str) -> dict | None:
    return found(holder, dict, "extensions", name)


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
        problem = f"texture cannot be decoded: {error}"
        raise Where(path).error(problem, "Replace the image") from error


def base_colour(material: Any) -> Colour:
    return clipped(factor(material)[:3])


def _number(value: Any, path: Path) -> float:
    if isinstance(value, (int, float)) and abs(value) <= 1e308:
        return float(value)
    problem = f"a material's factor is {str(value)[:40]!r}"
    raise Where(path).error(problem, "Give a finite number")


def _share(value: Any, otherwise: float, path: Path) -> float:
    """A factor from 0 to 1; ``otherwise`` where there is none."""
    return otherwise if value is None else min(max(_number(value, path), 0.0), 1.0)


def factor(material: Any) -> np.ndarray:
    """(4,) base colour and alpha, which trimesh holds as floats or as whole numbers."""
    from trimesh.visual.color import to_float  # slow to import

    given = material.baseColorFactor
    given = np.zeros(0) if given is None else to_float(given)[:4]
    return np.append(given, np.ones(4 - len(given)))


def clipped(colour: np.ndarray) -> Colour:
    """A colour in [0, 1]."""
    return triple(np.clip(np.asarray(colour, np.float64), 0, 1))
