"""Converts pbrt's materials to surfaces: Blinn-Phong, mirrors, glass, coats and veils.

With the lights divided by pi (``lights.py``) the diffuse colour is pbrt's Kd.  A microfacet lobe of
roughness ``alpha`` becomes the Blinn-Phong lobe of the same peak: exponent ``2 / alpha^2 - 2``
(Walter et al. 2007) and specular colour ``R / (4 alpha^2)``, R the reflectance at normal
incidence, clipped to one.  Smooth metals are mirrors, smooth coats reflect as glass of index 1.5.
Rough glass, coloured opacity, bumps and light that shines through are noted.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lfcore.readers.pbrt.lexer import Place
from lfcore.readers.pbrt.parameters import ParameterSet
from lfcore.readers.pbrt.spectra import METALS, metal_reflectance, parameter_rgb
from lfcore.readers.pbrt.textures import Texture, TextureTable, constant
from lfcore.scene.needs import DIELECTRIC, MIRROR_ROUGHNESS, TRACED_ROUGHNESS
from lfcore.scene.surface_mesh import Surface

METAL_DIFFUSE = 0.4
"""The diffuse share of a metal's reflectance.  Polished metal reflects its surroundings, which
Blinn-Phong cannot: outside the highlight a metal would be black."""
GLASSES = {
    "BK7": 1.5168, "BAF10": 1.6700, "FK51A": 1.4866, "LASF9": 1.8503, "F5": 1.6727,
    "SF10": 1.7283, "F10": 1.7283, "SF11": 1.7847, "F11": 1.7847,
}  # fmt: skip
"""The index of refraction, at 588 nm, of glasses given by name (Schott's data sheets); pbrt calls
SF5, SF10 and SF11 F5, F10 and F11."""
ROUNDING = 1e-4
"""What weights may be above 1."""
Resolved = tuple[Surface, Texture] | None
"""A surface with its texture and the image's uv transform; None if the material is no surface."""


@dataclass(frozen=True, eq=False)
class Definition:
    """A material directive, kept until a shape uses it."""

    kind: str
    parameters: ParameterSet


@dataclass(frozen=True)
class Look:
    """The diffuse texture, specular colour and shininess, and other fields of a surface."""

    diffuse: Texture
    specular: np.ndarray = field(default_factory=lambda: np.zeros(3))
    shininess: float = 32.0
    fields: dict[str, Any] = field(default_factory=dict)


MIRROR: dict[str, Any] = {"metallic": 1.0, "roughness": 0.0}


def is_traced(alpha: float) -> bool:
    """Whether the tracer follows what microfacets of this width reflect."""
    return math.sqrt(alpha) <= TRACED_ROUGHNESS


def _coat(strength: float, alpha: float) -> dict[str, Any]:
    """The fields of a coat, if it is traced."""
    if not is_traced(alpha) or not strength:
        return {}
    return {"clearcoat": min(strength, 1.0), "clearcoat_roughness": math.sqrt(alpha)}


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
            "glass": self._glass, "dielectric": self._glass, "thindielectric": self._glass,
            "mix": self._mix, "translucent": self._translucent,
            "diffuse": lambda entry: self._lambert(entry, "reflectance"),
            "plastic": lambda entry: self._glossy(entry, 0.25, DIELECTRIC),
            "substrate": lambda entry: self._glossy(entry, 0.5, 1.0),
        }  # fmt: skip
        look = makers.get(kind, self._unknown)(parameters)
        if parameters.get("bumpmap") or parameters.get("displacement"):
            parameters.left_out("bumps")
        parameters.note_unused()
        surface = Surface(
            name=parameters.owner.replace('"', ""),
            diffuse=tuple(np.clip(look.diffuse.factor, 0, None).tolist()),
            specular=tuple(np.asarray(look.specular, np.float64).tolist()),
            shininess=look.shininess,
            emission=emission,
            texture=look.diffuse.image,
            **look.fields,
        )
        return surface, look.diffuse

    def _matte(self, parameters: ParameterSet) -> Look:
        if self.textures.number(parameters, "sigma", 0.0) > 0:
            parameters.approximated("sigma, Lambert instead")
        return self._lambert(parameters, "Kd")

    def _lambert(self, parameters: ParameterSet, name: str) -> Look:
        return Look(self.textures.colour(parameters, name, 0.5))

    def _alpha(self, parameters: ParameterSet, default: float, version4: bool = False) -> float:
        rough = self.textures.number(parameters, "roughness", default)
        u = self.textures.number(parameters, "uroughness", rough)
        v = self.textures.number(parameters, "vroughness", rough)
        if u != v:
            parameters.approximated("anisotropy, mean roughness")
        rough = (u + v) / 2
        if not rough:
            return 0.0
        if not parameters.bool("remaproughness", True):
            return rough
        return float(np.sqrt(rough)) if version4 else roughness_to_alpha(rough)

    def _glossy(self, parameters: ParameterSet, default: float, reflectance: float) -> Look:
        diffuse = self.textures.colour(parameters, "Kd", default)
        gloss = self._weights(parameters, "Ks", default)
        alpha = self._alpha(parameters, 0.1)
        coat = float(gloss.max()) * reflectance / DIELECTRIC
        fields = _coat(coat, alpha)
        if fields and coat > 1:
            parameters.approximated("a coat of index 1.5")
        return Look(diffuse, *lobe(gloss * reflectance, alpha), fields)

    def _coated(self, parameters: ParameterSet) -> Look:
        diffuse = self.textures.colour(parameters, "reflectance", 0.5)
        alpha = self._alpha(parameters, 0.0, True)
        return Look(diffuse, *lobe(np.full(3, DIELECTRIC), alpha), _coat(1.0, alpha))

    def _uber(self, parameters: ParameterSet) -> Look:
        mirrored, passed = (self._weights(parameters, name, 0.0) for name in ("Kr", "Kt"))
        opacity = self._weights(parameters, "opacity", 1.0)
        index = self._index(parameters)
        look = self._glossy(parameters, 0.25, DIELECTRIC)
        fields: dict[str, Any] = {**look.fields, "opacity": float(opacity.mean())}
        if np.ptp(opacity):
            parameters.approximated("opacity without colour")
        if mirrored.any():
            fields |= {"clearcoat": float(mirrored.max()), "clearcoat_roughness": 0.0}
        diffuse = look.diffuse
        if passed.any():
            # The colours of both are their sum, shared so that the mean light of each is right.
            share = passed.mean() / (passed + diffuse.mean()).mean()
            fields |= {"transmission": float(share), "ior": index}
            brighter = (passed + diffuse.mean()) / np.maximum(diffuse.mean(), 1e-6)
            diffuse = replace(diffuse, factor=diffuse.factor * brighter)
            if not diffuse.factor.any():
                diffuse = constant(passed)
        return Look(diffuse, look.specular, look.shininess, fields)

    def _glass(self, parameters: ParameterSet) -> Look:
        passed = self._weights(parameters, "Kt", 1.0)
        mirrored = self._weights(parameters, "Kr", 1.0)
        if not np.allclose(mirrored, 1):
            parameters.approximated("all light that Fresnel's equations reflect (Kr)")
        version4 = "dielectric" in parameters.owner
        if math.sqrt(self._alpha(parameters, 0.0, version4)) > MIRROR_ROUGHNESS:
            parameters.approximated("smooth instead")
        thin = "thindielectric" in parameters.owner
        fields = {"transmission": 1.0, "ior": self._index(parameters), "thin_walled": thin}
        return Look(constant(passed), fields=fields)

    def _weights(self, parameters: ParameterSet, name: str, default: float) -> np.ndarray:
        """A colour parameter (3,) from 0 to 1; spectra and textures are cut off there."""
        values = self.textures.rgb(parameters, name, default)
        parameter = parameters.get(name)
        given = parameter is not None and parameter.type in ("rgb", "color", "float")
        if given and not ((values >= 0) & (values <= 1 + ROUNDING)).all():
            shown = " ".join(f"{value:g}" for value in values)
            raise parameters.error(name, f"is {shown}", "Give numbers from 0 to 1")
        return np.clip(values, 0, 1)

    def _index(self, parameters: ParameterSet) -> float:
        """The index of refraction, of a number or a glass's name."""
        found = 1.5
        for name in ("eta", "index"):
            parameter = parameters.get(name)
            if parameter is None:
                continue
            if isinstance(parameter.values, list):
                words = str(parameter.values[0]).replace("-", " ").replace(".", " ").split()
                found = next((GLASSES[word] for word in words if word in GLASSES), found)
                if not any(word in GLASSES for word in words):
                    parameters.approximated(f"index of refraction {found:g}", name)
            elif parameter.type == "spectrum":
                found = float(np.mean(parameter.values[1::2]))
            else:
                found = float(np.mean(parameter.values))
        if not found >= 1:
            key = "eta" if "eta" in parameters.items else "index"
            raise parameters.error(key, f"is {found:g}", "Give an index of at least 1")
        return found

    def _translucent(self, parameters: ParameterSet) -> Look:
        share = self._weights(parameters, "reflect", 0.5)
        if self._weights(parameters, "transmit", 0.5).any():
            parameters.left_out("light that shines through")
        look = self._glossy(parameters, 0.25, DIELECTRIC)
        diffuse = replace(look.diffuse, factor=look.diffuse.factor * share)
        return replace(look, diffuse=diffuse, specular=look.specular * share)

    def _metal(self, parameters: ParameterSet) -> Look:
        version4 = "conductor" in parameters.owner
        alpha = self._alpha(parameters, 0.0 if version4 else 0.01, version4)
        reflectance = self._metal_colour(parameters)
        if is_traced(alpha):
            return Look(constant(reflectance), fields=MIRROR | {"roughness": math.sqrt(alpha)})
        return Look(_metal_diffuse(parameters, reflectance), *lobe(reflectance, alpha))

    def _metal_colour(self, parameters: ParameterSet) -> np.ndarray:
        if "reflectance" in parameters.items:
            return self._weights(parameters, "reflectance", 0.8)
        eta, k = parameters.get("eta"), parameters.get("k")
        named = [p.values[0] for p in (eta, k) if p is not None and isinstance(p.values, list)]
        for metal, reflectance in METALS.items():
            if any(metal in name.replace("-", "/").replace(".", "/").split("/") for name in named):
                return np.array(reflectance)
        if eta is None or k is None:
            return np.array(METALS["Cu"])  # pbrt's default
        folder = self.textures.folder
        indices = parameter_rgb(eta, folder), parameter_rgb(k, folder)
        return np.clip(metal_reflectance(*indices), 0, 1)

    def _mirror(self, parameters: ParameterSet) -> Look:
        return Look(constant(self._weights(parameters, "Kr", 0.9)), fields=MIRROR)

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
        return Look(texture, specular, glossier.shininess, _mixed(a, b, weight))

    def _unknown(self, parameters: ParameterSet) -> Look:
        for name in ("Kd", "reflectance", "color", "Kr"):
            if name in parameters.items:
                parameters.approximated(f'as matte with its "{name}"')
                return self._lambert(parameters, name)
        parameters.approximated("as matte grey of 0.5")
        return Look(constant(0.5))


def _mixed(first: Surface, second: Surface, weight: float) -> dict[str, Any]:
    """The fields of mirrors, glass, coats and veils of a mixture; ``weight`` is the first's."""
    pairs = ((first, weight), (second, 1 - weight))
    fields: dict[str, Any] = {
        name: sum(share * getattr(surface, name) for surface, share in pairs)
        for name in ("transmission", "clearcoat", "opacity")
    }
    clearer = max(pairs, key=lambda pair: pair[1] * pair[0].transmission)[0]
    fields |= {"ior": clearer.ior, "thin_walled": clearer.thin_walled}
    if first.is_metallic or second.is_metallic:
        fields["metallic"] = sum(share * max(surface.metallic, 0) for surface, share in pairs)
        fields["roughness"] = min(first.roughness, second.roughness)
    return fields
