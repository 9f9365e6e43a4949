"""The materials of a glTF file, and their textures.

Source: Khronos, "glTF 2.0 Specification", sections 3.8, 3.9 and 5.19, and the extensions
KHR_texture_transform, KHR_materials_unlit, KHR_materials_emissive_strength,
KHR_materials_pbrSpecularGlossiness (its appendix, for metal and roughness), KHR_materials_ior,
KHR_materials_transmission, KHR_materials_volume and KHR_materials_clearcoat.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lfcore.colour import srgb_codes, srgb_decode
from lfcore.errors import LfcoreError, SceneError
from lfcore.pictures import codes_of, decode
from lfcore.readers.account import Account
from lfcore.readers.gltf.document import Document, extension
from lfcore.readers.gltf.extensions import WEBP
from lfcore.readers.side_files import SOLID, is_mask, same_size
from lfcore.reading import Where
from lfcore.scene.needs import DIELECTRIC, MIRROR_ROUGHNESS
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT
from lfcore.scene.surface_mesh import Surface, triple

GLOSSY, UNLIT = "KHR_materials_pbrSpecularGlossiness", "KHR_materials_unlit"
STRENGTH, MOVED = "KHR_materials_emissive_strength", "KHR_texture_transform"
REPEAT, NEAREST = 10497, 9728
WHITE, BLACK = (1.0, 1.0, 1.0), (0.0, 0.0, 0.0)
ROUNDING = 1e-4
"""What programs that write numbers in few digits may be beyond a range."""


@dataclass(frozen=True)
class Look:
    """A material as it is drawn.

    ``surface`` is None if nothing of it is seen.  All its textures have the coordinates of
    ``texture_set``, moved by ``move``, the entry of KHR_texture_transform.
    """

    name: str
    entry: dict
    surface: Surface | None
    texture_set: int = 0
    move: dict | None = None
    ends: bool = False


class Surfaces:
    """The surfaces of a document's materials, each made and noted once."""

    def __init__(self, document: Document, account: Account):
        self.document, self.account = document, account
        self._looks: dict[int | None, Look] = {}
        self._pictures: dict[int, np.ndarray] = {}
        self._dropped: set[int] = set()

    def look(self, index: int | None) -> Look:
        """The look of a material; None is the default material."""
        if index not in self._looks:
            entry = {} if index is None else self.document.entry("materials", index)
            name = str(entry.get("name") or self.document.path.stem)
            self._looks[index] = _Material(self, entry, name).look()
        return self._looks[index]

    def uvs(self, look: Look, coordinates: np.ndarray) -> np.ndarray:
        """Texture coordinates (T, 3, 2), v up; NaN, where a mesh is not unwrapped, becomes 0."""
        u, v = np.moveaxis(np.where(np.isnan(coordinates), 0.0, coordinates)[..., :2], -1, 0)
        if look.move:
            numbers = self.document.numbers
            across, down = numbers(look.move, "scale", (1.0, 1))
            right, below = numbers(look.move, "offset", (0.0, 0))
            turn = self.document.number(look.move, "rotation", 0.0)
            # Counter-clockwise as seen, with glTF's v down: as the reference viewers do.
            c, s = math.cos(turn), math.sin(turn)
            u, v = across * u, down * v
            u, v = c * u + s * v + right, c * v - s * u + below
        moved = np.stack([u, 1 - v], axis=-1)
        if look.ends and (moved.min(initial=0) < 0 or moved.max(initial=1) > 1):
            self.note(APPROXIMATED, look.name, "a texture that is clamped or mirrored; it repeats")
        return moved

    def note_colours(self, look: Look, colours: np.ndarray) -> None:
        """Note the parts of the vertices' colours (V, 3 or 4) that are lost."""
        if extension(look.entry, UNLIT) is not None:
            words = "colours of vertices, which unlit surfaces do not take"
            self.note(LEFT_OUT, look.name, words)
        transparent = colours.shape[1] == 4 and colours[:, 3].min(initial=1.0) < 1.0
        if transparent and look.entry.get("alphaMode") in ("MASK", "BLEND"):
            self.note(LEFT_OUT, look.name, "alpha of vertices")

    def note(self, kind: str, name: str, what: str) -> None:
        self.account.lose("materials", kind, f"material {name!r}: {what}", 0)

    def picture(self, texture: dict) -> np.ndarray:
        """(H, W, 4) uint8 of a texture's image."""
        source = self._source(texture)
        if source not in self._pictures:
            image = self.document.entry("images", source)
            is_embedded = "bufferView" in image
            where = Where(self.document.path, f"images[{source}]")
            try:
                data = bytes(self.document.view(image["bufferView"])) if is_embedded else (
                    self.document.data(image["uri"], "texture")
                )  # fmt: skip
                self._pictures[source] = codes_of(decode(data, alpha=True))
            except LfcoreError as error:
                name = (
                    image["uri"][:80] if "uri" in image and not is_embedded else "within the file"
                )
                remedy = f"Put a sound file within the mesh or in {self.document.path.parent}"
                raise where.error(f"texture {name!r}: {error.problem}", remedy) from None
        return self._pictures[source]

    def _source(self, texture: dict) -> int:
        source = (extension(texture, WEBP) or texture).get("source")
        if source is None:
            names = ", ".join(texture.get("extensions", ())) or "none"
            remedy = "Convert its textures to PNG, JPEG or WebP"
            raise self.document.broken(f"a texture has no picture but that of {names}", remedy)
        return source

    def drop(self, info: dict) -> None:
        """Remember a texture that is not used, for a reason that was noted."""
        self._dropped.add(self._source(self.document.entry("textures", info.get("index"))))

    def close(self) -> None:
        """Count materials and images."""
        count, tree = self.account, self.document.entries
        count.hold("materials", len(tree("materials")))
        count.use("materials", len(set(self._looks) - {None}))
        count.hold("images", len(tree("images")))
        count.use("images", len(self._pictures))
        count.lose("images", LEFT_OUT, "", len(self._dropped - set(self._pictures)))


class _Material:
    """One material on its way to a :class:`Look`."""

    def __init__(self, surfaces: Surfaces, entry: dict, name: str):
        self.surfaces, self.document = surfaces, surfaces.document
        self.entry, self.name = entry, name
        self.first: tuple[int, dict] | None = None
        self.ends = False

    def look(self) -> Look:
        document, entry = self.document, self.entry
        glossy = extension(entry, GLOSSY)
        surface, alpha, colours = self._metallic() if glossy is None else self._glossy(glossy)
        emission = np.clip(document.numbers(entry, "emissiveFactor", BLACK), 0, 1)
        strength = extension(entry, STRENGTH) or {}
        emission = emission * document.number(strength, "emissiveStrength", 1.0)
        changes: dict[str, Any] = {"emission": triple(emission)}
        if "emissiveTexture" in entry and emission.any():
            changes["emission_texture"] = self.texture(entry, "emissiveTexture")
        if "normalTexture" in entry:
            changes["normal_texture"] = self.texture(entry, "normalTexture", mean=False)
            changes["normal_scale"] = document.number(entry["normalTexture"], "scale", 1.0)
        if "occlusionTexture" in entry:
            self.surfaces.drop(entry["occlusionTexture"])
            self.note(LEFT_OUT, "baked shadows")
        holes = self._holes(alpha, colours)
        if holes is None:
            return Look(self.name, entry, None)
        changes |= holes
        if extension(entry, UNLIT) is not None:
            changes |= {
                "diffuse": BLACK, "emission": surface.diffuse, "metallic": -1.0,
                "metal_texture": None, "normal_texture": None, "emission_texture": surface.texture,
            }  # fmt: skip
        changes |= self._specular()
        try:
            surface = replace(surface, **changes)
        except SceneError as error:
            key = f"material {self.name!r}: {error.key}"
            raise error.named(SceneError, file=document.path, key=key) from None
        texture_set, move = self.first or (0, {})
        return Look(self.name, entry, surface, texture_set, move, self.ends)

    def _metallic(self) -> tuple[Surface, float, np.ndarray | None]:
        """Surface, alpha and (H, W, 4) base colours of metal and roughness."""
        entry = self.entry.get("pbrMetallicRoughness", {})
        colour = self._clipped(entry, "baseColorFactor", (*WHITE, 1.0))
        colours = self.texture(entry, "baseColorTexture", "RGBA")
        surface = Surface(
            self.name, triple(colour[:3]), texture=_opaque(colours),
            metallic=float(self._clipped(entry, "metallicFactor", 1.0)),
            roughness=float(self._clipped(entry, "roughnessFactor", 1.0)),
            metal_texture=self.texture(entry, "metallicRoughnessTexture"),
        )  # fmt: skip
        return surface, float(colour[3]), colours

    def _glossy(self, entry: dict) -> tuple[Surface, float, np.ndarray | None]:
        """The same, converted from diffuse and specular colours."""
        colour = self._clipped(entry, "diffuseFactor", (*WHITE, 1.0))
        specular = self._clipped(entry, "specularFactor", WHITE)
        gloss = float(self._clipped(entry, "glossinessFactor", 1.0))
        colours = self.texture(entry, "diffuseTexture", "RGBA")
        shine = self.texture(entry, "specularGlossinessTexture", "RGBA")
        if colours is None and shine is None:
            base, metal = as_metal(colour[:3], specular)
            surface = Surface(
                self.name, triple(base), metallic=float(metal), roughness=1 - gloss
            )  # fmt: skip
            return surface, float(colour[3]), None
        white = np.full((1, 1, 4), 255, np.uint8)
        diffuse_codes, gloss_codes = same_size(
            white if colours is None else colours, white if shine is None else shine
        )
        base, metal = as_metal(
            srgb_decode(diffuse_codes[..., :3] / 255.0) * colour[:3],
            srgb_decode(gloss_codes[..., :3] / 255.0) * specular,
        )
        rough = 1 - gloss * gloss_codes[..., 3] / 255.0
        codes = np.rint(255 * np.stack([np.zeros_like(rough), rough, metal], -1)).astype(np.uint8)
        base_codes = srgb_codes(base)
        surface = Surface(
            self.name, WHITE, texture=base_codes, metallic=1.0, roughness=1.0, metal_texture=codes
        )
        return surface, float(colour[3]), np.dstack([base_codes, diffuse_codes[..., 3]])

    def texture(
        self, holder: dict, key: str, mode: str = "RGB", *, mean: bool = True
    ) -> np.ndarray | None:
        """(H, W, 3 or 4) uint8 of a texture; None without a texture.

        A texture with other coordinates than the first is its mean, or None without ``mean``.
        """
        info = holder.get(key)
        if info is None:
            return None
        texture = self.document.entry("textures", info.get("index"))
        move = extension(info, MOVED) or {}
        place = move.get("texCoord", info.get("texCoord", 0)), {**move, "texCoord": 0}
        if self.first is None:
            self.first = place
        codes = self.surfaces.picture(texture)
        if place != self.first:
            consequence = "its mean is used" if mean else "it is left out"
            self.note(APPROXIMATED, f"{key} has coordinates of its own; {consequence}")
            if not mean:
                return None
            codes = _mean(codes, linear=key.startswith("metallic"))
        sampler = self._sampler(texture)
        self.ends |= any(sampler.get(key, REPEAT) != REPEAT for key in ("wrapS", "wrapT"))
        if sampler.get("magFilter") == NEAREST:
            self.note(APPROXIMATED, "a texture with sharp texels; they are interpolated")
        return codes if mode == "RGBA" else _opaque(codes)

    def _sampler(self, texture: dict) -> dict:
        return self.document.entry("samplers", texture["sampler"]) if "sampler" in texture else {}

    def _holes(self, alpha: float, colours: np.ndarray | None) -> dict[str, Any] | None:
        """The fields by which light passes straight; None if nothing of the surface is seen."""
        mode, number = self.entry.get("alphaMode", "OPAQUE"), self.document.number
        if mode not in ("MASK", "BLEND"):
            return {}
        least, most = (255, 255) if colours is None else (
            int(colours[..., 3].min(initial=255)), int(colours[..., 3].max(initial=0))
        )  # fmt: skip
        masks = alpha == 1 and colours is not None and is_mask(colours[..., 3])
        blends = mode == "BLEND" and not masks
        cutoff = number(self.entry, "alphaCutoff", 0.5) if mode == "MASK" else 0.5
        if alpha * most < (1 if blends else 255 * cutoff):
            self.note(LEFT_OUT, "cut out wholly")
            return None
        if blends:
            shown = {"alpha_blend": True, "texture": colours} if least < SOLID else {}
            return {"opacity": alpha, **shown}
        if alpha * least / 255 >= cutoff:
            return {}
        return {"alpha_cutoff": cutoff / alpha, "texture": colours}

    def _specular(self) -> dict[str, Any]:
        """The fields of glass and coats, of the extensions' values."""
        names = "ior", "transmission", "volume", "clearcoat"
        extensions = (extension(self.entry, f"KHR_materials_{name}") for name in names)
        ior, glass, volume, coat = (entry or {} for entry in extensions)
        for holder in (glass, volume, coat):
            for key, info in holder.items():
                if key.endswith("Texture"):
                    self.surfaces.drop(info)
                    self.note(LEFT_OUT, key)
        number = self._number
        if ior.get("ior") == 0:
            self.note(APPROXIMATED, "an ior of 0, which reflects all light, as 1.5")
            ior = {}
        if volume.get("attenuationDistance") == 0:
            self.note(APPROXIMATED, "an attenuationDistance of 0 as none")
        distance = number(volume, "attenuationDistance", math.inf, 0.0, math.inf)
        values: dict[str, Any] = {
            "ior": number(ior, "ior", 1.5, 1.0, math.inf),
            "transmission": number(glass, "transmissionFactor", 0.0),
            "thin_walled": not number(volume, "thicknessFactor", 0.0, 0.0, math.inf),
            "attenuation_distance_m": distance if math.isfinite(distance) else 0.0,
            "attenuation_colour": triple(self._numbers(volume, "attenuationColor", WHITE)),
            "clearcoat": number(coat, "clearcoatFactor", 0.0),
            "clearcoat_roughness": number(coat, "clearcoatRoughnessFactor", 0.0),
        }
        if values["transmission"]:
            rough = number(self.entry.get("pbrMetallicRoughness", {}), "roughnessFactor", 1.0)
            if rough > MIRROR_ROUGHNESS:
                self.note(APPROXIMATED, "rough glass, which is smooth")
            return values
        return {
            name: values[name] for name in ("ior", "clearcoat", "clearcoat_roughness")
        }  # fmt: skip

    def _number(
        self, holder: dict, key: str, default: float, least: float = 0.0, most: float = 1.0
    ) -> float:
        return float(self._numbers(holder, key, default, least, most))

    def _numbers(
        self, holder: dict, key: str, default: Any, least: float = 0.0, most: float = 1.0
    ) -> np.ndarray:
        """Numbers as of :meth:`Document.numbers` that are in a range; shares to rounding."""
        if key not in holder:
            return np.asarray(default, np.float64)
        values, more = self.document.numbers(holder, key, default), ROUNDING * (most == 1)
        if not ((values >= least - more) & (values <= most + more)).all():
            where = Where(self.document.path, f"material {self.name!r}: {key}")
            ends = f"from {least:g} to {most:g}" if math.isfinite(most) else f"from {least:g} on"
            raise where.error(f"cannot be {holder[key]}", f"Give numbers {ends}")
        return np.clip(values, least, most)

    def _clipped(self, holder: dict, key: str, default: Any) -> np.ndarray:
        """Shares that are cut off at 0 and 1, with a note."""
        values = self.document.numbers(holder, key, default)
        if not ((values >= -ROUNDING) & (values <= 1 + ROUNDING)).all():
            self.note(APPROXIMATED, f"{key} {holder[key]}, which is cut off at 0 and 1")
        return np.clip(values, 0, 1)

    def note(self, kind: str, what: str) -> None:
        self.surfaces.note(kind, self.name, what)


def as_metal(diffuse: np.ndarray, specular: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Base colour (..., 3) and metal (...) of diffuse and specular colours, linear RGB."""
    strength = 1 - specular.max(-1)
    weights = np.array([0.299, 0.587, 0.114])
    dark, bright = (np.sqrt((colour**2) @ weights) for colour in (diffuse, specular))
    # The metal m solves a m^2 + b m + c = 0.
    a = DIELECTRIC
    b = dark * strength / (1 - a) + bright - 2 * a
    c = a - bright
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0))
    metal = np.where(bright < a, 0.0, np.clip((root - b) / (2 * a), 0, 1))
    least = 1e-6
    of_diffuse = diffuse * (strength / (1 - a) / np.maximum(1 - metal, least))[..., None]
    rest = specular - (a * (1 - metal))[..., None]
    of_specular = rest / np.maximum(metal, least)[..., None]
    share = (metal * metal)[..., None]
    return np.clip(of_diffuse * (1 - share) + of_specular * share, 0, 1), metal


def _opaque(codes: np.ndarray | None) -> np.ndarray | None:
    return None if codes is None else np.ascontiguousarray(codes[..., :3])


def _mean(codes: np.ndarray, *, linear: bool) -> np.ndarray:
    """(1, 1, 4) of codes, which are numbers or sRGB."""
    if linear:
        return np.rint(codes.mean((0, 1), keepdims=True)).astype(np.uint8)
    colour = srgb_codes(srgb_decode(codes[..., :3] / 255.0).mean((0, 1), keepdims=True))
    return np.dstack([colour, np.rint(codes[..., 3:].mean((0, 1), keepdims=True)).astype(np.uint8)])
