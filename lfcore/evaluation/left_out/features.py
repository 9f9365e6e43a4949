"""Features that the kernels can leave out, one for each field of :class:`Needs`.

The *full* program has the feature compiled in and its buffers filled with neutral data: white
vertex colours, a light of no strength, black highlights.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lfcore.scene.appearance import DIRECTIONAL, Light
from lfcore.scene.baked import BakedLight
from lfcore.scene.model import Scene
from lfcore.scene.needs import Needs
from lfcore.scene.surface_mesh import face_normals

NO_LIGHT = 1e-30
"""The strength of the additional light: not black, and adds nothing."""


@dataclass(frozen=True)
class Feature:
    """A feature that a scene may lack, a ``field`` of :class:`Needs`.

    ``defines`` are macros of the kernels, none where they test the scene's own values; ``what`` is
    the code and data left out.  ``fill`` adds neutral data of the feature, for the full program;
    ``part`` is the part of the scene that both programs trace.
    """

    field: str
    defines: tuple[str, ...]
    what: str
    fill: Callable[[Scene], Scene] = lambda scene: scene
    part: Callable[[Scene], Scene] = lambda scene: scene

    def missing(self, needs: Needs) -> bool:
        """Whether a scene of these needs lacks it."""
        return not getattr(needs, self.field)


def _without_lights(scene: Scene) -> Scene:
    """So dim that it needs no more than white."""
    return replace(scene, lights=[], clip=False)


def _black_light(scene: Scene) -> Scene:
    """A sky needs baked light, too."""
    if scene.light:
        return scene
    grids = np.tile(np.array([0, 0, 1], np.int32), (scene.triangle_count, 1))
    return replace(scene, light=BakedLight(grids, np.zeros((3, 3), np.float32)))


def _black_sky(scene: Scene) -> Scene:
    return replace(_black_light(scene), sky=np.zeros((8, 8, 3), np.float32))


def _white_corners(scene: Scene) -> Scene:
    return replace(scene, colours=np.ones((scene.triangle_count, 3, 3), np.float32))


def _flat_normals(scene: Scene) -> Scene:
    if len(scene.normals):
        return scene
    normal = face_normals(scene.triangles.astype(np.float64)).astype(np.float32)
    return replace(scene, normals=np.repeat(normal[:, None], 3, axis=1))


def _unused_texture(scene: Scene) -> Scene:
    uvs = np.zeros((scene.triangle_count, 3, 2), np.float32)
    return replace(scene, uvs=uvs, textures=[np.full((2, 2, 3), 255, np.uint8)])


def _in_the_dark(scene: Scene) -> Scene:
    return replace(scene, ambient=(0.0,) * 3, background=(0.0,) * 3)


def _without_shadows(scene: Scene) -> Scene:
    return replace(scene, lights=[replace(light, casts_shadows=False) for light in scene.lights])


def _idle_light(*, shadows: bool) -> Callable[[Scene], Scene]:
    light = Light(DIRECTIONAL, (0.0, -1.0, 0.0), (NO_LIGHT,) * 3, casts_shadows=shadows)
    return lambda scene: replace(scene, lights=[*scene.lights, light])


FEATURES = (
    Feature("textures", ("TEXTURES",), "texture coordinates, texels, and their lookup",
            _unused_texture),
    # With holes, a block's rays are shadowed one by one, not by regions, which rounds otherwise.
    Feature("cut_outs", ("TEXTURES",), "holes, looked up where rays meet triangles (no shadows)",
            part=_without_shadows),
    Feature("physical", ("TEXTURES",), "metal, roughness, and textures that bend and vary them"),
    Feature("smooth_normals", ("SMOOTH",), "corner normals and their interpolation",
            _flat_normals),
    Feature("curved", ("CURVED",), "shadow rays that start beside the hit points",
            _flat_normals),
    Feature("vertex_colours", ("VERTEX_COLOURS",), "corner colours and their interpolation",
            _white_corners),
    Feature("specular", (), "highlights: half vector and power"),
    Feature("emission", (), "emission of materials"),
    Feature("ambient", (), "ambient light"),
    Feature("background", (), "colour of rays without a hit"),
    Feature("shadows", ("SHADOWS",),
            "shadow rays, hit points and unshadowed light",
            _idle_light(shadows=True)),
    Feature("directional_lights", (),
            "a directional light without shadows, and the question of each light's kind",
            _idle_light(shadows=False)),
    Feature("point_lights", (), "the question of each light's kind"),
    Feature("falloff", (), "fall-off with the distance of the light"),
    Feature("coloured_lights", (), "two of the three factors of a grey light"),
    Feature("emitters", (), "cosines at emitting surfaces, and their emission"),
    Feature("spots", (), "cones of lights"),
    Feature("baked", ("BAKED",), "baked light (without background and ambient light)",
            _black_light, _in_the_dark),
    Feature("sky", ("SKY",), "the sky and baked light (without background and ambient light)",
            _black_sky, _in_the_dark),
    Feature("stops", (), "sums of light above white (ambient light)", part=_without_lights),
)  # fmt: skip


def full_needs(filled: Scene, field: str) -> Needs:
    """Needs of the scene filled with a feature, the feature switched on whatever it finds."""
    needs = Needs.of(filled)
    value = getattr(needs, field)
    return replace(needs, **{field: value or type(value)(True)})
