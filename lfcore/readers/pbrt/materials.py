"""Converts pbrt's materials to Blinn-Phong surfaces.

With the lights divided by pi (``lights.py``) the diffuse colour is pbrt's Kd.  A microfacet lobe of
roughness ``alpha`` becomes the Blinn-Phong lobe of the same peak: exponent ``2 / alpha^2 - 2``
(Walter et al. 2007) and specular colour ``R / (4 alpha^2)``, R the reflectance at normal
incidence, clipped to one.  Mirror images, refraction, transparency and bumps, which Blinn-Phong
lacks, are noted.
"""

from dataclasses import dataclass, replace

import numpy as np

from lfcore.readers.pbrt.lexer import Place
from lfcore.readers.pbrt.parameters import ParameterSet
from lfcore.readers.pbrt.spectra import METALS, metal_reflectance, parameter_rgb
from lfcore.readers.pbrt.textures import Texture, TextureTable, constant
from lfcore.scene.needs import DIELECTRIC
from lfcore.scene.surface_mesh import Surface

METAL_DIFFUSE = 0.4
"""The diffuse share of a metal's reflectance.  Polished metal reflects its surroundings, which
Blinn-Phong cannot: outside the highlight a metal would be black."""
MIRROR_SHININESS = 2000.0
"""The exponent of a mirror's highlight."""
Look = tuple[Texture, np.ndarray, float]
"""The diffuse texture, specular colour, and shininess."""
Resolved = tuple[Surface, Texture] | None
"""A surface with its texture and the image's uv transform; None if the material is no surface."""


@dataclass(frozen=True, eq=False)
class Definition:
    """A material directive, kept until a shape uses it."""

    kind: str
    parameters: ParameterSet


def roughness_to_alpha(roughness: float) -> float:
    """Convert roughness in [0, 1] to the microfacet width, as pbrt version 3."""
    x = np.log(max(roughness, 1e-3))
    coefficients = (0.000640711, 0.0171201, 0.1734, 0.819955, 1.62142)
    return float(np.polyval(coefficients, x))


def lobe(reflectance: np.ndarray, alpha: float) -> tuple[np.ndarray, float]:
    """Return specular colour and exponent of the Blinn-Phong lobe with equal peak (see above)."""
    alpha = float(np.clip(alpha, 0.03, 1.0))
    shininess = max(1.0, 2.0 / alpha**2 - 2.0)
    return np.clip(reflectance / (4 * alpha**2), 0.0, 1.0), shininess


def _metal_diffuse(parameters: ParameterSet, reflectance: np.ndarray) -> Texture:
    parameters.approximated(f"highlights and {METAL_DIFFUSE:g} of its reflectance as diffuse")
    return constant(METAL_DIFFUSE * reflectance)


class MaterialTable:
    """The named materials, and surfaces, which are created from definitions on first use."""

    def __init__(self, textures: TextureTable):
        self.textures = textures
        self.named: dict[str, Definition] = {}
        self._resolved: dict[tuple[Definition, tuple], Resolved] = {}

    def find(self, name: str, place: Place) -> Definition:
        if name not in self.named:
            problem = f'material "{name}" is not defined'
            raise place.error(problem, "Define it with MakeNamedMaterial")
        return self.named[name]

    def resolve(self, definition: Definition, emission: tuple = (0.0, 0.0, 0.0)) -> Resolved:
        """Return the surface of a definition: one object per definition and emission."""
        key = definition, tuple(emission)
        if key not in self._resolved:
            self._resolved[key] = self._make(*key)
        return self._resolved[key]

    def _make(self, definition: Definition, emission: tuple) -> Resolved:
        kind, parameters = definition.kind, definition.parameters
        if kind in ("", "none", "interface"):
            return None
        makers = {
            "matte": self._matte, "uber": self._uber, "coateddiffuse": self._coated,
            "metal": self._metal, "conductor": self._metal, "mirror": self._mirror,
            "mix": self._mix,
            "diffuse": lambda entry: self._lambert(entry, "reflectance"),
            "plastic": lambda entry: self._glossy(entry, 0.25, DIELECTRIC),
            "substrate": lambda entry: self._glossy(entry, 0.5, 1.0),
        }  # fmt: skip
        texture, specular, shininess = makers.get(kind, self._unknown)(parameters)
        if parameters.get("bumpmap") or parameters.get("displacement"):
            parameters.left_out("bumps")
        parameters.note_unused()
        surface = Surface(
            name=parameters.owner.replace('"', ""),
            diffuse=tuple(np.clip(texture.factor, 0, None).tolist()),
            specular=tuple(np.asarray(specular, np.float64).tolist()),
            shininess=shininess,
            emission=emission,
            texture=texture.image,
        )
        return surface, texture

    def _matte(self, parameters: ParameterSet) -> Look:
        if self.textures.number(parameters, "sigma", 0.0) > 0:
            parameters.approximated("sigma, Lambert instead")
        return self._lambert(parameters, "Kd")

    def _lambert(self, parameters: ParameterSet, name: str) -> Look:
        return self.textures.colour(parameters, name, 0.5), np.zeros(3), 32.0

    def _alpha(self, parameters: ParameterSet, default: float, version4: bool = False) -> float:
        rough = self.textures.number(parameters, "roughness", default)
        u = self.textures.number(parameters, "uroughness", rough)
        v = self.textures.number(parameters, "vroughness", rough)
        if u != v:
            parameters.approximated("anisotropy, mean roughness")
        rough = (u + v) / 2
        if not parameters.bool("remaproughness", True):
            return rough
        return float(np.sqrt(rough)) if version4 else roughness_to_alpha(rough)

    def _glossy(self, parameters: ParameterSet, default: float, reflectance: float) -> Look:
        diffuse = self.textures.colour(parameters, "Kd", default)
        gloss = self.textures.rgb(parameters, "Ks", default)
        return diffuse, *lobe(gloss * reflectance, self._alpha(parameters, 0.1))

    def _coated(self, parameters: ParameterSet) -> Look:
        diffuse = self.textures.colour(parameters, "reflectance", 0.5)
        return diffuse, *lobe(np.full(3, DIELECTRIC), self._alpha(parameters, 0.0, True))

    def _uber(self, parameters: ParameterSet) -> Look:
        for name, effect in (("Kr", "mirror image"), ("Kt", "transmission")):
            if self.textures.rgb(parameters, name, 0.0).any():
                parameters.left_out(f"{effect} ({name})")
        if (self.textures.rgb(parameters, "opacity", 1.0) < 1).any():
            parameters.approximated("opaque instead")
        for name in ("eta", "index"):
            parameters.get(name)
        return self._glossy(parameters, 0.25, DIELECTRIC)

    def _metal(self, parameters: ParameterSet) -> Look:
        version4 = "conductor" in parameters.owner
        alpha = self._alpha(parameters, 0.0 if version4 else 0.01, version4)
        reflectance = self._metal_colour(parameters)
        return _metal_diffuse(parameters, reflectance), *lobe(reflectance, alpha)

    def _metal_colour(self, parameters: ParameterSet) -> np.ndarray:
        if "reflectance" in parameters.items:
            return self.textures.rgb(parameters, "reflectance", 0.8)
        eta, k = parameters.get("eta"), parameters.get("k")
        named = [p.values[0] for p in (eta, k) if p is not None and isinstance(p.values, list)]
        for metal, reflectance in METALS.items():
            if any(metal in name.replace("-", "/").replace(".", "/").split("/") for name in named):
                return np.array(reflectance)
        if eta is None or k is None:
            return np.array(METALS["Cu"])  # pbrt's default
        folder = self.textures.folder
        return metal_reflectance(parameter_rgb(eta, folder), parameter_rgb(k, folder))

    def _mirror(self, parameters: ParameterSet) -> Look:
        reflectance = self.textures.rgb(parameters, "Kr", 0.9)
        diffuse = _metal_diffuse(parameters, reflectance)
        return diffuse, np.clip(reflectance, 0, 1), MIRROR_SHININESS

    def _mix(self, parameters: ParameterSet) -> Look:
        pair = parameters.get("materials", "string")
        if pair is not None:  # version 4: amount is the weight of the second
            names: list[str | None] = list(pair.values)
            weight = 1.0 - self.textures.number(parameters, "amount", 0.5)
        else:
            names = [parameters.string(f"namedmaterial{n}") for n in (1, 2)]
            weight = float(self.textures.rgb(parameters, "amount", 0.5).mean())
        present = [name for name in names if name is not None]
        if len(present) != 2:
            raise parameters.place.error(f"{parameters.owner} wants two named materials")
        first, second = (self.resolve(self.find(name, parameters.place)) for name in present)
        if first is None or second is None:
            problem = f"{parameters.owner} mixes a material that is none"
            raise parameters.place.error(problem)
        a, b = first[0], second[0]
        halves = [
            replace(texture, factor=np.array(surface.diffuse) * share)
            for (surface, texture), share in ((first, weight), (second, 1.0 - weight))
        ]
        images = [half for half in halves if half.image is not None]
        if images:
            # There is one texture for the whole diffuse colour: the other half gets its pattern.
            pattern = max(images, key=lambda half: half.factor.sum())
            rest = sum((h.mean() for h in halves if h is not pattern), np.zeros(3))
            factor = pattern.factor * (1 + rest / np.maximum(pattern.mean(), 1e-6))
            texture = replace(pattern, factor=factor)
            parameters.approximated("one texture, of equal mean")
        else:
            texture = Texture(halves[0].factor + halves[1].factor)
        specular = weight * np.array(a.specular) + (1 - weight) * np.array(b.specular)
        glossier = max((a, b), key=lambda surface: sum(surface.specular))
        return texture, specular, glossier.shininess

    def _unknown(self, parameters: ParameterSet) -> Look:
        parameters.approximated("as matte grey of 0.5")
        for name in ("Kd", "reflectance", "color", "Kr"):
            if name in parameters.items:
                return self._lambert(parameters, name)
        return constant(0.5), np.zeros(3), 32.0
