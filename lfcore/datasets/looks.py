"""The materials of drawn things: colours, textures, metal, glass and clear coats."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from lfcore.datasets.shapes import POOL, Shape, procedural_texture, texture
from lfcore.errors import SceneError
from lfcore.scene.procedural.basics import Parts, Rng
from lfcore.scene.surface_mesh import Surface, triple

if TYPE_CHECKING:
    from lfcore.datasets.description import Description

BACKDROP = ("wall", "floor", "ceiling", "ground", "white paint", "print", "pane", "mirror")
"""The names of the materials behind objects."""
OF_GLASS = ("vase", "bottle", "tumbler", "goblet", "bowl")
"""The shapes that are often of glass."""
OF_METAL = ("pan", "brass")
"""The shapes and surfaces that are often of metal."""
OFTEN = 6
"""The factor of a material's share for things that are often made of it."""
BRASS = np.array([0.91, 0.78, 0.42])
"""Brass's reflectance, linear.  Source: https://physicallybased.info/, 2026."""


class Looks:
    """The random draws of materials, and of the files that they and shapes may need."""

    def __init__(self, description: Description, rng: Rng, split: str = ""):
        self.description, self.rng = description, rng
        files = description.mesh_files(), description.texture_files()
        self.meshes, self.textures = (description.of_split(each, split) for each in files)
        self.dropped: dict[str, str] = {}

    def span(self, limits: tuple[float, float, str]) -> float:
        low, high, kind = limits
        share = float(self.rng.random())
        return low * (high / low) ** share if kind == "log" else low + (high - low) * share

    def chance(self, share: float) -> bool:
        return float(self.rng.random()) < share

    def pick(self, options: Sequence[Any]) -> Any:
        return options[int(self.rng.integers(len(options)))]

    def picked(self, load: Callable[[Path], Any], files: list[Path]) -> Any:
        """Draw and load one of the files; the next file replaces an unreadable one, so that other
        scenes do not change."""
        first = int(self.rng.integers(len(files)))
        for file in (*files[first:], *files[:first]):
            loaded = load(file)
            if not isinstance(loaded, SceneError):
                return loaded
            self.dropped[file.name] = str(loaded)
        raise SceneError("cannot be read, nor can any other file", file=files[first])

    def dressed(self, shape: Shape) -> Parts:
        if shape.has_look:
            return shape.parts if shape.is_users else self._recoloured(shape.parts)
        surface, repeats = self.surface(shape.name), self.span(self.description.materials.repeats)
        if shape.is_users:  # it may be open: a volume of glass would have no end
            surface = replace(surface, thin_walled=surface.transmission > 0)
        flat = replace(surface, curved=False)
        return [
            replace(
                part,
                surface=flat if part.normals is None else surface,
                uvs=None if part.uvs is None else part.uvs * repeats,
            )
            for part in shape.parts
        ]

    def _recoloured(self, parts: Parts) -> Parts:
        """Return parts in other colours: each surface tinted, or all of one drawn material."""
        if self.chance(self.description.materials.share_redressed):
            drawn = replace(self.surface("redressed"), transmission=0.0)
            return [replace(part, surface=drawn) for part in parts]
        tinted: dict[int, Surface] = {}
        for part in parts:
            if id(part.surface) not in tinted:
                tinted[id(part.surface)] = self.varied(part.surface)
        return [replace(part, surface=tinted[id(part.surface)]) for part in parts]

    def varied(self, surface: Surface) -> Surface:
        """Return a surface in another colour; brass may become polished or brushed metal."""
        if surface.name == "brass" and self.chance(self._share("brass", "metal")):
            steel = 0.6 * np.ones(3)
            return self.metal(replace(surface, diffuse=triple(self.pick((BRASS, steel)))))
        tint = 0.4 + 0.7 * self.rng.random(3)
        colour = np.clip(np.array(surface.diffuse) * tint, 0, 1)
        return replace(surface, diffuse=triple(colour))

    def surface(self, name: str) -> Surface:
        """Draw the material of an object or, without metal, glass and coats, of the backdrop."""
        keys = self.description.materials
        colour, picture = self._colour(), None
        if self.chance(keys.share_textured):
            number = int(self.rng.integers(POOL))
            picture = (
                self.picked(texture, self.textures) if self.textures
                else procedural_texture(self.description.seed, number)
            )  # fmt: skip
            colour = 0.6 + 0.4 * colour
        drawn = Surface(
            name, triple(colour), metallic=0.0, roughness=self.span(keys.roughness),
            texture=picture, curved=name not in (*BACKDROP, "block"),
        )  # fmt: skip
        if name in BACKDROP:
            return drawn
        kind = float(self.rng.random())
        metal, glass = self._share(name, "metal"), self._share(name, "glass")
        if kind < metal:
            return self.metal(drawn)
        if kind < metal + glass:
            return self.glass(name)
        return self.coated(drawn)

    def _share(self, name: str, material: str) -> float:
        """Return the probability of a material for a thing of this name."""
        share = getattr(self.description.materials, f"share_{material}")
        often = {"metal": OF_METAL, "glass": OF_GLASS}[material]
        return min(1.0, OFTEN * share) if name in often else share

    def metal(self, surface: Surface) -> Surface:
        """Return a surface of metal: polished, which is a mirror, or brushed."""
        keys = self.description.materials
        polished = self.chance(keys.share_polished)
        roughness = 0.0 if polished else self.span(keys.roughness)
        return replace(surface, metallic=1.0, roughness=roughness)

    def glass(self, name: str) -> Surface:
        """Draw clear or coloured glass."""
        least = 0.9 if self.chance(0.6) else 0.35
        tint = least + (0.98 - least) * self.rng.random(3)
        return Surface(name, triple(tint), metallic=0.0, roughness=0.0, transmission=1.0)

    def coated(self, surface: Surface) -> Surface:
        """Return the surface, perhaps with a clear coat."""
        coat = float(self.chance(self.description.materials.share_coated))
        return replace(surface, clearcoat=coat)

    def _colour(self) -> np.ndarray:
        drawn = self.rng.random(3)
        return np.minimum(0.04 + 0.43 * (drawn + drawn.mean()) ** 1.5, 0.95)

    def tint(self) -> np.ndarray:
        """Draw a colour from tungsten light to sky light."""
        warm = float(self.rng.random())
        return np.array([0.85 + 0.15 * warm, 0.93, 1.0 - 0.2 * warm])
