"""Blender's Cycles (the package ``bpy``) through a thin lens, with its own denoiser.

The same: triangles, normals, textures, lights, lens, focus, box filter of a pixel; ambient light is
emission of the surfaces, seen by the camera alone.  Different: highlights are left out (both
renderers get a matt scene), and values are not clipped to [0, 1] per ray; so each is compared with
its own converged picture.  With bounces, the sky and emitters light all surfaces.
"""

import math
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.peers.method import Renderer, Samples, check_installed
from benchmarks.peers.mitsuba import check_plain, panorama, without_suns
from lfcore.exr import read_exr_picture
from lfcore.optics.camera import Camera
from lfcore.scene.appearance import POINT
from lfcore.scene.model import Scene

POWER = 4 * math.pi**2
"""Blender's watts of a point light per unit of our irradiance at one metre of a white surface."""
_here: dict[str, Any] = {}


def matt(scene: Scene) -> Scene:
    """Return the scene without highlights and metal."""
    plain = [replace(m, specular=(0.0, 0.0, 0.0), metallic=-1.0) for m in scene.every_material]
    return replace(scene, materials=plain)


def cycles_lens(scene: Scene, threads: int, bounces: int = 0) -> Renderer:
    """Open Cycles with a matt scene.

    Raises :class:`SkippedError` for a missing package, or a scene that we do not translate.
    """
    check_installed("bpy")
    check_plain(scene, may_bounce=bounces > 0)
    scene = without_suns(scene) if bounces else scene
    return Renderer(_open, (scene, threads, bounces), _picture, "the package bpy")


def _open(scene: Scene, threads: int, bounces: int) -> None:
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    blender = bpy.context.scene
    blender.render.engine = "CYCLES"
    blender.render.threads_mode, blender.render.threads = "FIXED", threads
    blender.render.use_persistent_data = True
    blender.render.image_settings.file_format = "OPEN_EXR"
    blender.render.image_settings.color_depth = "32"
    cycles = blender.cycles
    cycles.max_bounces = cycles.diffuse_bounces = bounces
    cycles.use_adaptive_sampling, cycles.sample_clamp_indirect = False, 0
    cycles.pixel_filter_type, cycles.denoiser = "BOX", "OPENIMAGEDENOISE"
    cycles.filter_width = 1.0
    _world(bpy, blender, scene)
    _mesh(bpy, blender, scene, bounces > 0)
    for light in scene.lights:
        _light(bpy, blender, light)
    camera = bpy.data.cameras.new("camera")
    blender.camera = bpy.data.objects.new("camera", camera)
    blender.collection.objects.link(blender.camera)
    _here.update(bpy=bpy, folder=tempfile.TemporaryDirectory(prefix="cycles-"))


def _world(bpy, blender, scene: Scene) -> None:
    """Add the background, which emits no light, or the sky, which does."""
    world = blender.world = bpy.data.worlds.new("world")
    world.use_nodes = True
    colour = world.node_tree.nodes["Background"].inputs[0]
    colour.default_value = (*scene.background, 1)
    if len(scene.sky):
        light = panorama(scene.sky, -np.eye(3))[::-1]
        image = bpy.data.images.new("sky", *light.shape[1::-1], float_buffer=True)
        image.pixels.foreach_set(np.dstack([light, np.ones_like(light[..., :1])]).ravel())
        texture = world.node_tree.nodes.new("ShaderNodeTexEnvironment")
        texture.image = image
        world.node_tree.links.new(texture.outputs["Color"], colour)
        return
    world.cycles.sampling_method = "NONE"
    world.cycles_visibility.diffuse = False


def _mesh(bpy, blender, scene: Scene, lights: bool) -> None:
    count, mesh = scene.triangle_count, bpy.data.meshes.new("triangles")
    flip = np.array([1, -1, -1], np.float32)  # Blender's cameras look along -z, y up
    mesh.vertices.add(3 * count)
    mesh.vertices.foreach_set("co", (scene.triangles * flip).ravel())
    mesh.loops.add(3 * count)
    mesh.loops.foreach_set("vertex_index", np.arange(3 * count, dtype=np.int32))
    mesh.polygons.add(count)
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * count, 3, dtype=np.int32))
    mesh.polygons.foreach_set("material_index", scene.material_ids.astype(np.int32))
    if len(scene.uvs):
        mesh.uv_layers.new(name="uv").data.foreach_set("uv", scene.uvs.ravel())
    for index in range(len(scene.every_material)):
        mesh.materials.append(_material(bpy, scene, index, lights))
    mesh.update()
    if len(scene.normals):
        mesh.normals_split_custom_set((scene.normals * flip).reshape(-1, 3).tolist())
    blender.collection.objects.link(bpy.data.objects.new("triangles", mesh))


def _material(bpy, scene: Scene, index: int, lights: bool):
    """Create a material: diffuse; emission of ambient light times its colour, for camera rays; and
    its own emission, for all rays if it ``lights``."""
    ours = scene.every_material[index]
    material = bpy.data.materials.new(f"material {index}")
    material.use_nodes = True
    nodes, link = material.node_tree.nodes, material.node_tree.links.new
    nodes.clear()

    def product(colour, factor):
        node = nodes.new("ShaderNodeVectorMath")
        node.operation = "MULTIPLY"
        node.inputs[1].default_value = factor
        if hasattr(colour, "is_linked"):
            link(colour, node.inputs[0])
        else:
            node.inputs[0].default_value = colour
        return node.outputs[0]

    if ours.texture >= 0 and len(scene.uvs):
        texture = nodes.new("ShaderNodeTexImage")
        texture.image = _image(bpy, scene, ours.texture)
        diffuse = product(texture.outputs["Color"], ours.diffuse)
    else:
        diffuse = product((1, 1, 1), ours.diffuse)
    surface, output = nodes.new("ShaderNodeBsdfDiffuse"), nodes.new("ShaderNodeOutputMaterial")
    link(diffuse, surface.inputs["Color"])
    shader = surface.outputs[0]
    to_camera = nodes.new("ShaderNodeLightPath").outputs["Is Camera Ray"]
    ambient = (0.0, 0.0, 0.0) if len(scene.sky) else scene.ambient
    for colour, for_all in ((product(diffuse, ambient), False),
                            (product((1, 1, 1), ours.emission), lights)):  # fmt: skip
        emission, total = nodes.new("ShaderNodeEmission"), nodes.new("ShaderNodeAddShader")
        link(colour, emission.inputs["Color"])
        if not for_all:
            link(to_camera, emission.inputs["Strength"])
        link(shader, total.inputs[0])
        link(emission.outputs[0], total.inputs[1])
        shader = total.outputs[0]
    link(shader, output.inputs["Surface"])
    material.cycles.emission_sampling = "FRONT_BACK" if lights and any(ours.emission) else "NONE"
    return material


def _image(bpy, scene: Scene, number: int):
    name = f"texture {number}"
    if name not in bpy.data.images:
        codes = scene.textures[number][::-1, :, :3] / 255.0
        height, width = codes.shape[:2]
        image = bpy.data.images.new(name, width, height)
        opaque = np.concatenate([codes, np.ones((height, width, 1))], 2)
        image.pixels.foreach_set(opaque.astype(np.float32).ravel())
        image.pack()
    return bpy.data.images[name]


def _light(bpy, blender, light) -> None:
    point, strength = light.kind == POINT, max(light.colour)
    lamp_data = bpy.data.lights.new("light", "POINT" if point else "SUN")
    lamp_data.color = [c / strength for c in light.colour] if strength else (0, 0, 0)
    lamp_data.use_shadow = light.casts_shadows
    lamp = bpy.data.objects.new("light", lamp_data)
    blender.collection.objects.link(lamp)
    x, y, z = light.vector[0], -light.vector[1], -light.vector[2]
    if point:
        lamp_data.energy = POWER * strength * (light.reference_distance_m or 1.0) ** 2
        lamp_data.shadow_soft_size, lamp.location = 0, (x, y, z)
    else:
        from mathutils import Vector  # comes with bpy

        lamp_data.energy, lamp_data.angle = math.pi * strength, 0
        lamp.rotation_mode = "QUATERNION"
        lamp.rotation_quaternion = Vector((x, y, z)).to_track_quat("Z", "Y")


def _picture(camera: Camera, pixels: int, samples: Samples, seed: int):
    bpy, folder = _here["bpy"], Path(_here["folder"].name)
    blender = bpy.context.scene
    data = blender.camera.data
    data.angle = 2 * math.atan(camera.field_width / 2)
    data.dof.use_dof, data.dof.focus_distance = True, camera.focus_m
    data.dof.aperture_fstop = data.lens * 1e-3 / (2 * camera.lens_radius_m)
    data.clip_start, data.clip_end = 1e-3, 1e5
    blender.render.resolution_x = blender.render.resolution_y = pixels
    blender.cycles.samples, blender.cycles.seed = samples.per_pixel, seed
    blender.cycles.use_denoising = bool(samples.denoise)
    with_more = samples.denoise == "auxiliary"
    blender.cycles.denoising_input_passes = "RGB_ALBEDO_NORMAL" if with_more else "RGB"
    blender.render.filepath = str(folder / "picture.exr")
    begun = time.process_time()
    bpy.ops.render.render(write_still=True)
    seconds = time.process_time() - begun
    return read_exr_picture(folder / "picture.exr").astype(np.float32), seconds
