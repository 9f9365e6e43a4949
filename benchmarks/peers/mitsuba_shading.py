"""Our shading as an integrator of Mitsuba, as `lfcore.oracle.shading`.

Values are clipped to [0, 1] per ray; textures are not filtered by a footprint.
"""

import numpy as np

from lfcore.colour import srgb_decode
from lfcore.scene.appearance import POINT
from lfcore.scene.model import Scene

LEAST_ROUGHNESS = 0.05
"""The least roughness of metal, as in our kernels."""


def shading_of(scene: Scene):
    """Return the class of the integrator, with the scene's tables on Mitsuba's device."""
    import drjit as dr
    import mitsuba as mi

    texels, places = [np.zeros(3, np.float32)], [(0, 1, 1)]
    for texture in scene.textures:
        places.append((sum(len(t) for t in texels) // 3, texture.shape[1], texture.shape[0]))
        texels.append(srgb_decode(texture[..., :3] / 255.0).astype(np.float32).ravel())
    atlas = mi.Float(np.concatenate(texels))
    used = [places[material.texture + 1] for material in scene.every_material]
    place = [mi.UInt32(np.array(column, np.uint32)) for column in zip(*used, strict=True)]
    textured = mi.Bool([material.texture >= 0 for material in scene.every_material])
    material_ids = mi.UInt32(scene.material_ids.astype(np.uint32))

    def table(name: str):
        return mi.Float(
            np.array([getattr(m, name) for m in scene.every_material], np.float32).ravel()
        )

    diffuse, specular, emission = map(table, ("diffuse", "specular", "emission"))
    shininess, metallic, rough = map(table, ("shininess", "metallic", "roughness"))
    has_metal = any(material.is_metallic for material in scene.every_material)

    def texture_colour(material, uv, active):
        """Interpolate bilinearly, with wrapping; v increases from bottom to top."""
        start, width, height = (dr.gather(mi.UInt32, column, material, active) for column in place)
        x = uv.x * mi.Float(width) - 0.5
        y = (1 - uv.y) * mi.Float(height) - 0.5
        left, top = dr.floor(x), dr.floor(y)
        share_x, share_y = x - left, y - top

        def wrapped(index, size):
            size = mi.Int32(dr.maximum(size, 1))  # 0 in inactive lanes
            rest = mi.Int32(index) % size
            return mi.UInt32(dr.select(rest < 0, rest + size, rest))

        colour = mi.Color3f(0)
        for right, part_x in ((0, 1 - share_x), (1, share_x)):
            for below, part_y in ((0, 1 - share_y), (1, share_y)):
                column, row = wrapped(left + right, width), wrapped(top + below, height)
                at = start + row * width + column
                colour += part_x * part_y * dr.gather(mi.Color3f, atlas, at, active)
        return colour

    def microfacets(base, metal, roughness, normal, towards, view):
        """Return pi times the BRDF of glTF 2.0's appendix B, times the cosine."""
        half = dr.normalize(towards + view)
        f0 = dr.lerp(mi.Color3f(0.04), base, metal)
        fresnel = f0 + (1 - f0) * (1 - dr.dot(view, half)) ** 5
        square = dr.maximum(roughness, LEAST_ROUGHNESS) ** 4
        light = dr.maximum(dr.dot(normal, towards), 0)
        seen = dr.abs(dr.dot(normal, view))
        peak = square / dr.square(dr.square(dr.dot(normal, half)) * (square - 1) + 1)
        for cosine in (light, seen):
            peak /= cosine + dr.sqrt(square + (1 - square) * dr.square(cosine))
        return ((1 - fresnel) * (1 - metal) * base + fresnel * peak) * light

    class Shading(mi.SamplingIntegrator):
        """Blinn-Phong and microfacets, ambient light and shadows."""

        def __init__(self, properties):
            super().__init__(properties)
            self.auxiliary = properties.get("auxiliary", False)

        def aov_names(self):
            return ["a.R", "a.G", "a.B", "n.X", "n.Y", "n.Z"] if self.auxiliary else []

        def sample(self, mi_scene, sampler, ray, medium=None, active=True):
            si = mi_scene.ray_intersect(ray, active=active)
            hit = active & si.is_valid()
            material = dr.gather(mi.UInt32, material_ids, si.prim_index, hit)
            view = -ray.d
            normal = mi.Vector3f(si.sh_frame.n)
            normal = dr.select(dr.dot(normal, view) < 0, -normal, normal)
            albedo = dr.gather(mi.Color3f, diffuse, material, hit)
            mapped = hit & dr.gather(mi.Bool, textured, material, hit)
            albedo *= dr.select(mapped, texture_colour(material, si.uv, mapped), 1)
            gloss = dr.gather(mi.Color3f, specular, material, hit)
            power = dr.gather(mi.Float, shininess, material, hit)
            colour = dr.gather(mi.Color3f, emission, material, hit)
            metal = dr.gather(mi.Float, metallic, material, hit)
            roughness = dr.gather(mi.Float, rough, material, hit)
            around = albedo
            if has_metal:
                shown = (1 - metal) * albedo + dr.lerp(mi.Color3f(0.04), albedo, metal)
                around = dr.select(metal >= 0, shown, albedo)
            colour += mi.Color3f(scene.ambient) * around
            for light in scene.lights:
                vector = mi.Vector3f(light.vector)
                if light.kind == POINT:
                    away = vector - si.p
                    distance = dr.norm(away)
                    towards, strength = away / distance, mi.Color3f(light.colour)
                    if light.reference_distance_m:
                        strength *= dr.square(light.reference_distance_m / distance)
                    shadow = si.spawn_ray_to(vector)
                else:
                    towards, strength = dr.normalize(vector), mi.Color3f(light.colour)
                    shadow = si.spawn_ray(towards)
                cosine = dr.dot(normal, towards)
                lit = hit & (cosine > 0)
                if light.casts_shadows:
                    lit &= ~mi_scene.ray_test(shadow, active=lit)
                shine = dr.power(dr.maximum(dr.dot(normal, dr.normalize(towards + view)), 0), power)
                reflected = albedo * cosine + gloss * shine
                if has_metal:
                    facets = microfacets(albedo, metal, roughness, normal, towards, view)
                    reflected = dr.select(metal >= 0, facets, reflected)
                colour += dr.select(lit, strength * reflected, 0)
            colour = dr.select(hit, colour, mi.Color3f(scene.background))
            extra = []
            if self.auxiliary:
                extra = [*dr.select(hit, albedo, 0), *dr.select(hit, mi.Color3f(normal), 0)]
            return dr.clip(colour, 0, 1), mi.Bool(True), extra

    return Shading
