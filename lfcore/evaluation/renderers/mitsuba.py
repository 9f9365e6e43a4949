"""Mitsuba 3: a scene with the same triangles, materials, lights and thin lens, and its picture.

Mitsuba has no Blinn-Phong lobe (materials with a highlight become its rough plastic of a similar
width), no ambient light and no lights without shadows (left out); it draws lens points of the round
lens at random.  A scene without lights is ambient light alone, which is exact: surfaces become
emitters.
"""

import importlib
import math
from types import ModuleType
from typing import Any

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.errors import SceneError
from lfcore.evaluation.renderers.rendered import NotRenderedError, Rendered, timed
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.rendering.direct import focused_camera
from lfcore.scene.appearance import POINT, Light, Material
from lfcore.scene.model import Scene
from lfcore.scene.needs import check_exportable, is_metal


def start(variant: str, threads: int) -> ModuleType:
    """Import Mitsuba with a variant, e.g. ``scalar_rgb``, and as many threads beside our own."""
    mitsuba = importlib.import_module("mitsuba")
    mitsuba.set_variant(variant)
    importlib.import_module("drjit").set_thread_count(threads)
    return mitsuba


def render_mitsuba(scene: Scene, plane: SensorPlane, pixels: int, views: int) -> Rendered:
    """Render by Mitsuba's scalar variant, which runs on every processor, on one thread."""
    try:
        mitsuba = start("scalar_rgb", 0)
    except (ImportError, RuntimeError) as error:
        raise NotRenderedError(f"mitsuba is not installed, or does not run here: {error}") from None
    lens = thin_lens(mitsuba, focused_camera(scene.camera, plane), pixels)
    loaded = mitsuba.load_dict(Description(mitsuba, scene).all() | {"sensor": lens})
    note, rays = f"Mitsuba {mitsuba.__version__} scalar_rgb, random lens points", views**2
    return timed(lambda: np.asarray(mitsuba.render(loaded, spp=rays)), "Mitsuba 3", rays, note)


def thin_lens(
    mitsuba: ModuleType, camera: Camera, pixels: int, sampler: str = "independent"
) -> dict:
    """The focused lens, and square pictures of ``pixels`` per side."""
    transform = mitsuba.ScalarTransform4f()
    return {
        "type": "thinlens",
        "to_world": transform.look_at([0, 0, 0], [0, 0, 1], [0, -1, 0]),
        "fov": 2 * math.degrees(math.atan(camera.field_width / 2)),
        "aperture_radius": camera.lens_radius_m,
        "focus_distance": camera.focus_m,
        "near_clip": 0.001,
        "far_clip": 1.0e5,
        "sampler": {"type": sampler},
        "film": {
            "type": "hdrfilm", "width": pixels, "height": pixels, "rfilter": {"type": "box"},
            "pixel_format": "rgb",
        },
    }  # fmt: skip


def mesh_of(
    mitsuba: ModuleType, name: str, corners: np.ndarray, normals: np.ndarray, uvs: np.ndarray,
    props: Any = None,
) -> Any:  # fmt: skip
    """A mesh of ``corners``, ``normals`` (T, 3, 3) and ``uvs`` (T, 3, 2) as a :class:`Scene` has
    them, the latter two empty for a mesh without."""
    mesh = mitsuba.Mesh(
        name, 3 * len(corners), len(corners), has_vertex_normals=len(normals) > 0,
        has_vertex_texcoords=len(uvs) > 0, props=props or mitsuba.Properties(),
    )  # fmt: skip
    values = mitsuba.traverse(mesh)
    values["vertex_positions"] = corners.ravel()
    values["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
    if len(normals):
        values["vertex_normals"] = normals.ravel()
    if len(uvs):
        values["vertex_texcoords"] = uvs.ravel()
    values.update()
    return mesh


class Description:
    """Turns a scene into Mitsuba's dictionary.

    ``mitsuba`` is the module, its variant set.
    """

    def __init__(self, mitsuba: ModuleType, scene: Scene, *, leave_out_ambient: bool = False):
        self.mitsuba, self._scene = mitsuba, scene
        lit = leave_out_ambient or any(any(light.colour) for light in scene.lights)
        self._is_ambient = not lit
        check_exportable(scene, "Mitsuba", may_be_specular=True)
        if any(scene.ambient) and lit and not leave_out_ambient:
            remedy = "Leave it out, or compare a scene that has no other light"
            raise SceneError("Mitsuba has no ambient light", file=scene.name, remedy=remedy)

    def all(self) -> dict:
        """The dictionary for ``mitsuba.load_dict``, without a sensor."""
        integrator = {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0}
        if self._is_ambient:
            integrator = {"type": "path", "max_depth": 1}
        out = {"type": "scene", "integrator": integrator}
        for index, light in enumerate(self._scene.lights):
            if light.casts_shadows and any(light.colour):
                out[f"light_{index}"] = self._light(light)
        for material in range(len(self._scene.every_material)):
            mesh = self._mesh(material)
            if mesh is not None:
                out[f"mesh_{material}"] = mesh
        return out

    def _light(self, light: Light) -> dict:
        # A diffuse surface here returns its colour times the irradiance, without 1/pi.
        colour = [math.pi * c for c in light.colour]
        if light.kind == POINT:
            scale = (light.reference_distance_m or 1.0) ** 2
            value = {"type": "rgb", "value": [c * scale for c in colour]}
            return {"type": "point", "position": list(light.vector), "intensity": value}
        value = {"type": "rgb", "value": colour}
        direction = [-c for c in light.vector]
        return {"type": "directional", "direction": direction, "irradiance": value}

    def radiance(self, material: int) -> dict | None:
        """The light that a material's surfaces emit, if any."""
        light = self._scene.ambient, self._scene.every_material[material].emission
        return self._colour(material, *map(np.array, light)) if self._is_ambient else None

    def _mesh(self, material: int) -> Any:
        scene, mitsuba = self._scene, self.mitsuba
        members = np.flatnonzero(scene.material_ids == material)
        if not len(members):
            return None
        props = mitsuba.Properties()
        props["bsdf"] = mitsuba.load_dict(self.bsdf(material))
        if radiance := self.radiance(material):
            props["emitter"] = mitsuba.load_dict({"type": "area", "radiance": radiance})
        normals, uvs = (a[members] if len(a) else a for a in (scene.normals, scene.uvs))
        uvs = np.stack([uvs[..., 0], 1 - uvs[..., 1]], -1)
        name = f"material {material}"
        return mesh_of(mitsuba, name, scene.triangles[members], normals, uvs, props)

    def _colour(self, index: int, light: np.ndarray, emission: np.ndarray) -> dict:
        """Diffuse colour times ``light``, plus ``emission`` where there is no texture."""
        material, scene = self._scene.every_material[index], self._scene
        diffuse = np.array(material.diffuse) * light
        if material.texture < 0 or not len(scene.uvs):
            return {"type": "rgb", "value": (diffuse + emission).tolist()}
        if emission.any():
            problem = f"the emission of material {material.name!r} over a texture is not exported"
            raise SceneError(problem, file=scene.name)
        texels = srgb_decode(scene.textures[material.texture][..., :3] / 255.0) * diffuse
        bitmap = self.mitsuba.Bitmap(np.ascontiguousarray(texels, np.float32))
        return {"type": "bitmap", "bitmap": bitmap, "filter_type": "bilinear", "raw": True}

    def bsdf(self, index: int) -> dict:
        """How a material reflects and transmits."""
        material = self._scene.every_material[index]
        colour = self._colour(index, np.ones(3), np.zeros(3))
        if material.transmission:
            kind = "thindielectric" if material.thin_walled else "dielectric"
            return {"type": kind, "int_ior": material.ior, "specular_transmittance": colour}
        body = {"type": "twosided", "inner": self._reflection(material, colour)}
        if material.opacity == 1:
            return body
        return {"type": "mask", "opacity": material.opacity, "inner": body}

    def _reflection(self, material: Material, colour: dict) -> dict:
        if is_metal(material):
            smooth = {"type": "conductor", "material": "none", "specular_reflectance": colour}
            rough = {
                "type": "roughconductor",
                "distribution": "ggx",
                "alpha": material.roughness**2,
            }
            return smooth | rough if material.roughness else smooth
        if material.clearcoat:
            return {"type": "plastic", "int_ior": 1.5, "diffuse_reflectance": colour}
        if not any(material.specular):
            return {"type": "diffuse", "reflectance": colour}
        # The Blinn-Phong exponent n is about Beckmann's 2 / alpha^2 - 2.
        return {
            "type": "roughplastic",
            "distribution": "beckmann",
            "alpha": math.sqrt(2 / (material.shininess + 2)),
            "diffuse_reflectance": colour,
        }
