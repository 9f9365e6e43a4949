"""The records, arguments and constants that host and kernels share.

The C header of the tracer's programs is made of them (:mod:`lfcore.opencl.interface`).
"""

import numpy as np

from lfcore.opencl.interface import FLOAT, INT, SHARED, UINT, Interface, given, read, write
from lfcore.scene.limits import MOST_ATTENUATION
from lfcore.scene.needs import (
    DIELECTRIC,
    FLAT_NORMALS,
    LEAST_ROUGHNESS,
    MIRROR_ROUGHNESS,
    TRACED_ROUGHNESS,
)
from lfcore.scene.sky_gloss import LEVELS, SHARES, SIDE
from lfcore.tracing.alpha_test import ALPHA_TEST

MIP_LEVELS, MOST_LEVELS, NODE_WIDTH, TEXEL_BITS = 12, 64, 16, 10
BAKED_BITS, BAKED_BIAS = 9, 15
TEXTURED, ALPHA_TESTS, PHYSICAL = 1, 2, 4
LOBE_PART = 0.25
"""The width of the filter of what a rough mirror shows, in lobes: measured, docs/decisions.md."""
LINE = 64
MAP_BASE, MAP_NORMAL, MAP_METAL, MAP_EMISSION, MAPS = range(5)
CONSTANTS: dict[str, int | float] = {
    "NODE_WIDTH": NODE_WIDTH,  # children of a node, and triangles of a leaf
    "MOST_LEVELS": MOST_LEVELS,  # levels of a hierarchy that the kernels' stacks hold
    "MIP_LEVELS": MIP_LEVELS,
    "TEXEL_BITS": TEXEL_BITS,  # per channel of a texel
    "BAKED_BITS": BAKED_BITS,  # per channel of baked light, below an exponent
    "BAKED_BIAS": BAKED_BIAS,  # of that exponent
    "FAR": 3.0e38,  # beyond every depth
    "FLAT_NORMALS": FLAT_NORMALS,  # corners' normals that differ by less are a flat triangle's
    "MOST_ATTENUATION": MOST_ATTENUATION,
    "MOST_HITS": 64,  # of a path, with those at which nothing happens
    "SPLITS": 2,  # events at which a path splits
    "COAT": 1.5,  # the index of refraction of a clear coat
    "MIRROR_ROUGHNESS": MIRROR_ROUGHNESS, "TRACED_ROUGHNESS": TRACED_ROUGHNESS,
    "LOBE_PART": LOBE_PART,
    "DIELECTRIC": DIELECTRIC, "LEAST_ROUGHNESS": LEAST_ROUGHNESS,  # scene/needs.py
    "TEXTURED_BIT": TEXTURED,  # of TEXTURES, what a program is built with
    "ALPHA_TESTS_BIT": ALPHA_TESTS,  # triangles with holes
    "PHYSICAL_BIT": PHYSICAL,  # see Needs.physical
    "LINE": LINE,  # bytes, to which the scene's arrays are aligned
    "MAP_BASE": MAP_BASE, "MAP_NORMAL": MAP_NORMAL, "MAP_METAL": MAP_METAL,  # of a material
    "MAP_EMISSION": MAP_EMISSION, "MAPS": MAPS,
    "GLOSS_LEVELS": LEVELS, "GLOSS_SIDE": SIDE, "GLOSS_SHARES": SHARES,  # scene/sky_gloss.py
}  # fmt: skip
"""The constants, by their names in kernels."""

MATERIAL = np.dtype([
    ("diffuse", FLOAT, 3),
    ("specular", FLOAT, 3),
    ("shininess", FLOAT),
    ("specular_cutoff", FLOAT),  # there is no highlight where its cosine is lower
    ("emission", FLOAT, 3),
    ("metallic", FLOAT),  # negative: a Blinn-Phong material
    ("roughness", FLOAT),
    ("normal_scale", FLOAT),
    ("curved", INT),  # see Material.curved
    ("maps", INT, MAPS),  # textures; -1: none
    ("opacity", FLOAT),
    ("alpha_blend", INT),
    ("transmission", FLOAT),
    ("ior", FLOAT),
    ("thin_walled", INT),
    ("absorption", FLOAT, 3),  # 1 / metre
    ("clear", INT),  # whether light passes
    ("sends_on", INT),  # whether rays are mirrored or pass
    ("clearcoat", FLOAT),
    ("clearcoat_roughness", FLOAT),
])  # fmt: skip
LIGHT = np.dtype([
    ("vector", FLOAT, 3),  # position of a point light, else the direction towards the light
    ("is_point", INT),
    ("colour", FLOAT, 3),
    ("reference_distance", FLOAT),  # at which a light that falls off has its colour; 0: no fall-off
    ("normal", FLOAT, 3),  # of an emitter at this point, or the axis of a spot; else 0
    ("cone", FLOAT, 2),  # spots: slope and offset of a line in the cosine to the axis, whose square
    # is the attenuation; slope 0: no spot
    ("triangles", INT, 2),  # first and one past the last of the emitter's, which never shadow it
    ("visible", INT),  # to mirrored rays
])  # fmt: skip
MIP_LEVEL = np.dtype([("offset", INT), ("width", INT), ("height", INT), ("levels", INT)])
"""A mip level of a texture: its first texel, its size, and the number of the texture's levels."""
BOXES = np.dtype([("low", FLOAT, (3, NODE_WIDTH)), ("high", FLOAT, (3, NODE_WIDTH))])
"""The boxes of a node's children: lowest and highest x, y and z."""
LEAF = np.dtype([("corner", FLOAT, (3, 3, NODE_WIDTH))])
"""The triangles of a leaf: x, y and z of corners p, q and r."""
SCENE_ARRAYS = (
    "boxes", "children", "leaves", "leaf_ids", "alpha_test_of", "alpha_tests", "alpha",
    "corners", "attributes", "material_ids", "materials", "lights", "mip_levels",
    "texels", "grids", "baked_light", "sky",
)  # fmt: skip
"""The arrays of a hierarchy and of surfaces, which are one buffer of a device."""
SCENE_STARTS = np.dtype([(name, UINT) for name in SCENE_ARRAYS])
"""Where they begin there, in lines."""
SCENE_ARGUMENTS = np.dtype([
    ("starts", SCENE_STARTS),
    ("ambient", FLOAT, 3),
    ("background", FLOAT, 3),
    ("unshadowed_lights", INT),  # these come first
    ("shadow_lights", INT),
    ("curved", INT),  # whether shadow rays start beside some hit points
    ("sky_side", INT),  # texels of the sky
    ("clear_low", FLOAT, 3),  # the box around triangles that light passes
    ("clear_high", FLOAT, 3),
])  # fmt: skip
RAY_ARGUMENTS = np.dtype([
    ("step", FLOAT, 4),  # sx, sy, tx, ty: per column and row of the inner grid
    ("outer", FLOAT, 2),  # a, b: per element of a block
    ("columns", INT),  # size of the inner grid
    ("rows", INT),
    ("first_row", INT),  # of the rows that are traced, and the one behind the last
    ("end_row", INT),
    ("packets", INT),
    ("pixel_pitch", FLOAT),  # tangent between neighbouring pixels
    ("half_extent", FLOAT),  # of a block, in columns
    ("side", INT),  # blocks along a side of a packet
    ("across", INT),  # elements in a row of a radiance image
    ("add", INT),  # whether radiance is added to what is there
])  # fmt: skip
PATH_ARGUMENTS = np.dtype([
    ("most_events", INT),
    ("lens_pitch", FLOAT),  # of the slab whose rays these are, metres; 0: unknown
    ("pixel_pitch", FLOAT),  # likewise, a tangent
    ("lens_bits", INT),  # the logarithm to base 2 of its lens samples per axis, at most 3
])  # fmt: skip
SEEN = np.dtype([
    ("own", FLOAT, 3), ("own_depth", FLOAT), ("specular", FLOAT, 3), ("specular_depth", FLOAT),
    ("cut", FLOAT),
])  # fmt: skip
"""What a ray sees: see :class:`lfcore.tracing.specular.SeenParts`."""
RAY_HIT = np.dtype([
    ("triangle", INT),  # -1 for a miss
    ("distance", FLOAT),  # in units of the ray's direction
    ("weights", FLOAT, 3),  # barycentric, of the triangle's corners
])  # fmt: skip
"""The hit of a given ray."""

RECORDS = {
    "MaterialRecord": MATERIAL, "LightRecord": LIGHT, "AlphaTest": ALPHA_TEST,
    "MipLevel": MIP_LEVEL, "Boxes": BOXES, "Leaf": LEAF,
    "SceneStarts": SCENE_STARTS, "SceneArguments": SCENE_ARGUMENTS,
    "RayArguments": RAY_ARGUMENTS, "RayHit": RAY_HIT,
    "PathArguments": PATH_ARGUMENTS, "Seen": SEEN,
}  # fmt: skip
"""The structs, by their names in kernels; one that holds another comes after it."""

_COMMON = (
    read(scene="uchar")
    | given(scene_numbers="SceneArguments", ray_numbers="RayArguments")
    | write(next_packet="int", scratch="uint")
)
_SHADED = write(radiance="float", albedo="float", normal="float")
KERNELS = {
    "trace_bundles": _COMMON
    | read(centre_rays="float4", members="int")
    | write(triangle="int", depth="float")
    | _SHADED,
    "trace_given": _COMMON
    | read(origins="float", directions="float")
    | write(hits="RayHit")
    | read(footprints="float")
    | _SHADED,
    "trace_paths": _COMMON
    | given(path_numbers="PathArguments")
    | read(origins="float", directions="float", triangle="int")
    | write(seen="Seen"),
}
"""The parameters of each kernel, name -> type; entry/trace.cl explains them."""
SINKS = {
    "HITS": ("trace_bundles", ("radiance", "albedo", "normal")),
    "IMAGE": ("trace_bundles", ("albedo", "normal")),
    "SURFACE": ("trace_bundles", ("triangle", "depth")),
    "GIVEN": ("trace_given", ("footprints", "radiance", "albedo", "normal")),
    "GIVEN_LIGHT": ("trace_given", ("albedo", "normal")),
    "GIVEN_SURFACE": ("trace_given", ()),
    "PATHS": ("trace_paths", ()),
}
"""The sinks, with their kernels and those of its parameters that the sink does not use."""
_FOLDERS = "simd traversal coverage surface shadows shading paths output entry"
INTERFACE = SHARED | Interface(
    tuple(f"tracing/kernels/{stage}" for stage in _FOLDERS.split()),
    CONSTANTS | {sink: number for number, sink in enumerate(SINKS)},
    RECORDS,
    KERNELS,
)
"""What the tracer's programs share with the host."""
