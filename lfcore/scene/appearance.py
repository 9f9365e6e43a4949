"""How triangles look and what lights them: materials and lights, as the tracer has them."""

from dataclasses import dataclass

POINT, DIRECTIONAL = 0, 1


@dataclass(frozen=True)
class Material:
    """What a surface is made of, all colours linear RGB in [0, 1].

    It reflects by Blinn-Phong: ``diffuse``, ``specular`` and ``shininess``; or, where ``metallic``
    is not negative, as glTF's metal (1) or what is none (0) of a ``roughness``, with ``diffuse``
    as base colour.  Textures index :attr:`Scene.textures` (-1: none).  ``metal_texture``
    multiplies roughness by its green and metal by its blue, ``normal_texture`` bends normals, its
    x and y ``normal_scale`` times, and ``emission_texture`` multiplies ``emission``.

    ``texture`` multiplies ``diffuse``.  ``emission`` is added whatever the light: a lamp shade, a
    screen, test charts.  Where the texture's alpha, of 1, is below ``alpha_cutoff`` is a hole.
    Of a ``curved`` material smooth normals are those of a curved surface, where shadow rays start:
    few triangles then cast no jagged shadows on themselves.
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

    @property
    def is_metallic(self) -> bool:
        return self.metallic >= 0

    @property
    def data_textures(self) -> tuple[int, int]:
        """Those whose codes are numbers, and no sRGB."""
        return self.metal_texture, self.normal_texture

    @property
    def textures(self) -> tuple[int, ...]:
        """All that it has."""
        every = (self.texture, *self.data_textures, self.emission_texture)
        return tuple(number for number in every if number >= 0)


@dataclass(frozen=True)
class Light:
    """A point or directional light in camera space.

    ``vector`` is the position in metres (:data:`POINT`) or the unit direction *towards* the
    light (:data:`DIRECTIONAL`).  ``colour`` is linear RGB: for a point light the irradiance at
    ``reference_distance_m`` (inverse-square fall-off; 0 means no fall-off), for a directional
    light the irradiance everywhere.

    A point light may be a point of a surface that glows: with a ``normal`` (unit, camera space;
    zero: shines to all sides) it gives the cosine to it times as much, and nothing behind.  The
    triangles ``own``, from the first to before the second number, never shadow it.

    Or it is a spot along its ``normal``, with ``cone`` the cosines of the angles at which it begins
    to fade and is dark; from the second to the first its strength grows as the square of a line,
    as in glTF.
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
