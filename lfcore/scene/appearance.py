"""Materials and lights of a scene."""

from dataclasses import dataclass

POINT, DIRECTIONAL = 0, 1


@dataclass(frozen=True)
class Dielectric:
    """A glTF file's values for glass and clear coats.  They are kept, and not drawn yet.

    Parameters
    ----------
    ior : float
        Index of refraction.
    transmission : float
        Share of light that enters, 0 to 1.
    thickness : float
        Thickness of the volume below the surface in the file's units; 0 is a thin wall.
    attenuation_distance : float
        Distance in the file's units after which white light has ``attenuation_colour``; 0: never.
    attenuation_colour : (float, float, float)
        Linear RGB.
    clearcoat, clearcoat_roughness : float
        Strength and roughness of a clear coat, 0 to 1.
    """

    ior: float = 1.5
    transmission: float = 0.0
    thickness: float = 0.0
    attenuation_distance: float = 0.0
    attenuation_colour: tuple[float, float, float] = (1.0, 1.0, 1.0)
    clearcoat: float = 0.0
    clearcoat_roughness: float = 0.0


@dataclass(frozen=True)
class Material:
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
    dielectric : Dielectric, optional
        A file's values for glass and clear coats.
    """

    name: str
    diffuse: tuple[float, float, float] = (0.8, 0.8, 0.8)
    specular: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shininess: float = 32.0
    emission: tuple[float, float, float] = (0.0, 0.0, 0.0)
    texture: int = -1
    alpha_cutoff: float = 0.0
    metallic: float = -1.0
    roughness: float = 1.0
    metal_texture: int = -1
    normal_texture: int = -1
    normal_scale: float = 1.0
    emission_texture: int = -1
    curved: bool = False
    dielectric: Dielectric | None = None

    @property
    def is_metallic(self) -> bool:
        return self.metallic >= 0

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
    """

    kind: int
    vector: tuple[float, float, float]
    colour: tuple[float, float, float]
    reference_distance_m: float = 0.0
    casts_shadows: bool = True
    normal: tuple[float, float, float] = (0.0, 0.0, 0.0)
    own: tuple[int, int] = (0, 0)
    cone: tuple[float, float] = (0.0, 0.0)

    @property
    def is_of_emitter(self) -> bool:
        return (any(self.normal) and not self.is_spot) or self.own[0] < self.own[1]

    @property
    def is_spot(self) -> bool:
        return any(self.cone)
