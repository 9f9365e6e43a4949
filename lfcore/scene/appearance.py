"""Materials and lights of a scene."""

import math
from dataclasses import dataclass

POINT, DIRECTIONAL = 0, 1
RANGES = {
    "metallic": (-1.0, 1.0), "roughness": (0.0, 1.0), "opacity": (0.0, 1.0),
    "transmission": (0.0, 1.0), "ior": (1.0, 1e6), "attenuation_distance_m": (0.0, 1e12),
    "clearcoat": (0.0, 1.0), "clearcoat_roughness": (0.0, 1.0),
}  # fmt: skip
"""The least and the largest value of numbers of a material."""
LATER = (
    "opacity", "alpha_blend", "transmission", "ior", "thin_walled", "attenuation_distance_m",
    "attenuation_colour", "clearcoat", "clearcoat_roughness", "angular_radius",
)  # fmt: skip
"""The fields of materials and lights that scene files omit where they have their default."""
DARKEST = 1e-6
"""The least attenuation colour: white light that passed through black glass is not quite 0."""


@dataclass(frozen=True, eq=False)
class Appearance:
    """The fields that a :class:`Material` and a surface with textures as arrays share."""

    name: str = "default"
    diffuse: tuple[float, float, float] = (0.8, 0.8, 0.8)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: float = 32.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_cutoff: float = 0.0
    metallic: float = -1.0
    roughness: float = 1.0
    normal_scale: float = 1.0
    curved: bool = False
    opacity: float = 1.0
    alpha_blend: bool = False
    transmission: float = 0.0
    ior: float = 1.5
    thin_walled: bool = False
    attenuation_distance_m: float = 0.0
    attenuation_colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0

    @property
    def is_metallic(self) -> bool:
        return self.metallic >= 0

    @property
    def absorption(self) -> tuple[float, float, float]:
        """The coefficients of Beer's law in the volume, linear RGB, 1 / metre."""
        if self.thin_walled or not self.attenuation_distance_m:
            return 0.0, 0.0, 0.0
        distance = self.attenuation_distance_m
        red, green, blue = (
            -math.log(max(share, DARKEST)) / distance for share in self.attenuation_colour
        )
        return red, green, blue


@dataclass(frozen=True)
class Material(Appearance):
    """A material: Blinn-Phong, or glTF's metallic-roughness model.

    Colours are linear RGB in [0, 1].  Textures index :attr:`Scene.textures`; -1 is none.

    Parameters
    ----------
    name : str
        The material's name.
    diffuse : (float, float, float)
        Diffuse reflectance, or the base colour of the metallic-roughness model.
    specular : (float, float, float)
        Blinn-Phong's specular reflectance.
    shininess : float
        Blinn-Phong's exponent.
    emission : (float, float, float)
        Emitted radiance, for example of a lamp shade, a screen or a test chart.
    texture : int
        Multiplies ``diffuse``.
    alpha_cutoff : float
        The texture cuts a hole where its alpha, 0 to 1, is below this value.
    metallic : float
        0 (dielectric) to 1 (metal) selects the metallic-roughness model; below 0 Blinn-Phong.
    roughness : float
        Roughness of the metallic-roughness model, 0 to 1.
    metal_texture : int
        Its green channel multiplies ``roughness``, its blue channel ``metallic``.
    normal_texture : int
        The normal map.
    normal_scale : float
        Multiplies x and y of the normal map.
    emission_texture : int
        Multiplies ``emission``.
    curved : bool
        Shadow rays start on the curved surface that the smooth normals describe, so that a coarse
        mesh casts no jagged shadows on itself.
    opacity : float
        Share of light that meets the surface, 0 to 1; the rest passes straight through.
    alpha_blend : bool
        The texture's alpha multiplies ``opacity``.
    transmission : float
        Share of light, 0 to 1, that enters in place of the diffuse reflection, multiplied by the
        diffuse colour: 1 is smooth glass.
    ior : float
        Index of refraction of transmission, and of the reflection of a metallic-roughness material
        that is no metal, at least 1.
    thin_walled : bool
        The surface is a pane without thickness, which light crosses straight.  Otherwise it
        bounds a volume, which is behind its front: the side from which corners are
        counter-clockwise.
    attenuation_distance_m : float
        Metres in the volume after which white light has ``attenuation_colour``; 0: never.
    attenuation_colour : (float, float, float)
        Linear RGB, 0 to 1.
    clearcoat : float
        Strength of a clear coat over everything else, 0 to 1; its index of refraction is 1.5.
    clearcoat_roughness : float
        Roughness of the coat, 0 to 1.
    """

    texture: int = -1
    metal_texture: int = -1
    normal_texture: int = -1
    emission_texture: int = -1

    @property
    def data_textures(self) -> tuple[int, int]:
        """The textures whose codes are linear numbers, not sRGB."""
        return self.metal_texture, self.normal_texture

    @property
    def has_maps(self) -> bool:
        """Whether it has textures beside that of its colour."""
        return max(*self.data_textures, self.emission_texture) >= 0

    @property
    def textures(self) -> tuple[int, ...]:
        """The numbers of all its textures."""
        every = (self.texture, *self.data_textures, self.emission_texture)
        return tuple(number for number in every if number >= 0)


@dataclass(frozen=True)
class Light:
    """A point, spot or directional light in camera space.

    Parameters
    ----------
    kind : int
        :data:`POINT` (0) or :data:`DIRECTIONAL` (1).
    vector : (float, float, float)
        The position of a point light, metres; the unit direction towards a directional light.
    colour : (float, float, float)
        Linear RGB irradiance: at ``reference_distance_m`` from a point light, everywhere for a
        directional light.
    reference_distance_m : float
        The distance of ``colour``, with inverse-square fall-off; 0: no fall-off.
    casts_shadows : bool
        Whether triangles occlude the light.
    normal : (float, float, float)
        The unit normal of an emitter's point, whose light falls off with the cosine to the normal
        and is 0 behind it; or the axis of a spot.  Zero: equal light in all directions.
    own : (int, int)
        The emitter's first triangle, and the one after its last: they do not occlude the light.
    cone : (float, float)
        A spot's cosines to its axis where it begins to fade and where it is dark.  Between them
        the light is the square of an affine function of the cosine, as in glTF.
    angular_radius : float
        The radius of a sun that the sky shows, radians; 0: the sky does not show the light.
    """

    kind: int
    vector: tuple[float, float, float]
    colour: tuple[float, float, float]
    reference_distance_m: float = 0.0
    casts_shadows: bool = True
    normal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    own: tuple[int, int] = (0, 0)
    cone: tuple[float, float] = (0.0, 0.0)
    angular_radius: float = 0.0

    @property
    def is_visible(self) -> bool:
        """Whether mirrored rays meet it: an emitter's surface, or a sun in the sky."""
        return self.is_of_emitter or self.angular_radius > 0

    @property
    def is_of_emitter(self) -> bool:
        return (any(self.normal) and not self.is_spot) or self.own[0] < self.own[1]

    @property
    def is_spot(self) -> bool:
        return any(self.cone)
