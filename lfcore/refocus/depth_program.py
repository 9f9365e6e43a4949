"""The program of slicing by depth: what it shares with the host."""

import numpy as np

from lfcore.opencl.interface import FLOAT, INT, SHARED, Interface, given, read, write

ABREAST = 16
"""The rays of a row, or squares of rays, that are processed together."""
PATCH_ROWS, PATCH_COLUMNS = 4, 4 * ABREAST
"""A patch: the rows and columns of ABREAST squares of 4 x 4 rays."""
STEP_BITS = 8
"""Edges of boxes are multiples of 1 / 2^STEP_BITS pixel."""
MOST_BOUNDS = 6
"""The most sweeps between the layers on each side of a plane."""
COARSE_PX = 1.25
"""The largest pixel of a view, in pixels of the picture, whose pattern a pixel averages away."""
FULL_LAYERS = 3
"""Layers on each side of the plane with all pixels in large pictures; with two, pictures lose up to
3 dB."""
LEAST_UNITS = 1024.0
"""The least sum, in units, that determines a colour: each added part may be off by one."""
MOST_DIOPTRES = 3e38
"""The inverse depth above which there is no ray: depth 0."""
LENS_NODES = 33
"""The nodes per axis of a view's grid behind a lens from a file, see NODE."""
LENS_EXTENT = 1.25
"""The side of that grid, in longer sides of the picture."""
NODE = {
    "displacement": slice(0, 2),  # of rays from where a perfect lens takes them, pixels
    "middle": slice(2, 4),  # from the middle of the cell's part in the aperture, metres
    "side": slice(4, 6),  # over that part's
    "sweep": slice(6, 8),  # change of the displacement across the lens, pixels per metre
    "blur": slice(8, 10),  # square of a box's side, for the rest of this change, pixels^2
    "share": slice(10, 11),  # of the rays inside the aperture that pass the lens
    "reach": slice(11, 12),  # how much farther light goes up or down about this row, pixels
    "reach_m": slice(12, 13),  # likewise, metres of the lens
    "apart": slice(13, 14),  # the most that red or blue is displaced from green, pixels
}
"""The parts of a node: how the rays of a view's cell land there.  The rest of 16 floats is 0."""

CONSTANTS = {
    "ABREAST": ABREAST,
    "STEP_BITS": STEP_BITS,
    "STEPS": 1 << STEP_BITS,
    "COARSE_PX": COARSE_PX,
    "FULL_LAYERS": FULL_LAYERS,
    "PATCH_ROWS": PATCH_ROWS,
    "PATCH_COLUMNS": PATCH_COLUMNS,
    "LEAST_UNITS": LEAST_UNITS,
    "MOST_DIOPTRES": MOST_DIOPTRES,
    # The least width of a box, in distances of rays, that a square of rays shares.  With these
    # widths, pictures from squares of 4 x 4 rays differ from those of 2 x 2 by 66 dB or more, and
    # those of 2 x 2 from single rays by 69 dB.
    "SHARED_BY_FOURS": 32.0,
    "SHARED_BY_TWOS": 16.0,
    "SHARED_BY_SMALL_TWOS": 8.0,
    "SHARED_SWEEPS": 8.0,  # sweeps of a square's rays differ by at most one part in so many
    # Powers of the inverse of the plastic number: M. Roberts' sequence R2 over a view's rays.
    "DITHER_X": 0.7548777,
    "DITHER_Y": 0.5698403,
    # Pixels of the smallest box of a narrow layer that is added as differences, behind a lens.
    "LARGE_BOX_PX": 12.0,
    # The most that red and blue may be displaced from green's box and share it, in pixels or, if
    # this is more, sides of the box.
    "COLOURS_PX": 0.05,
    "LENS_NODES": LENS_NODES,
    "LENS_EXTENT": LENS_EXTENT,
}
SLICING_ARGUMENTS = np.dtype([
    ("views", INT),
    ("columns", INT),  # of the rays of a view
    ("rows", INT),
    ("first_row", INT),  # of these rows in the whole views
    ("strip_rows", INT),
    ("width", INT),  # of the pictures
    ("height", INT),
    ("least_box", FLOAT),  # the least side of a box, pixels
    ("white", FLOAT),  # radiance 1 in sums, over a ray's weight
    ("brightest", FLOAT),  # radiance to which rays are clipped
    ("empty", FLOAT),  # radiance of pixels without rays
    ("parts", INT),  # 2: `shown` and `reflections` are there
    ("sparse", INT),  # 1: `present` is there
    ("axis_x", FLOAT),  # the optical axis's place in the picture
    ("axis_y", FLOAT),
])  # fmt: skip
PLACED_VIEW = np.dtype([
    ("x", FLOAT),  # position of pixel (0, 0)'s ray, pixels of the picture
    ("y", FLOAT),
    ("offset_x", FLOAT),  # from the lens point to the middle of its cell's open part, metres
    ("offset_y", FLOAT),
    ("side_x", FLOAT),  # of the cell's open part, metres
    ("side_y", FLOAT),
    ("weight", FLOAT),  # the open share of the cell, in units of the sums
    ("dither", FLOAT),  # of pixel (0, 0)'s ray, a share of a unit
])  # fmt: skip
"""A view on a plane."""
FOCUS_PLANE = np.dtype([
    ("delta", FLOAT),  # inverse focus distance
    ("scale", FLOAT),  # pixels of the picture per metre of the lens and dioptre
    ("step", FLOAT),  # pixels of the picture from one pixel of a view to the next
    ("pitch", FLOAT),  # of the lens samples, metres
    ("bounds", FLOAT, MOST_BOUNDS),  # sweeps between layers, pixels
])  # fmt: skip
SQUARES = np.dtype([
    ("sums", FLOAT, (4, ABREAST)),  # of red, green, blue and dioptres
    ("low", FLOAT, ABREAST),  # the least dioptres
    ("high", FLOAT, ABREAST),
])  # fmt: skip
"""ABREAST squares of 4 x 4 rays, side by side."""

_RAYS = read(light="light_t", depth="depth_t", dioptres="float")
_SUMS = write(sums="sum4", used="int")
KERNELS = {
    # Rays: light is (views, rows, columns, 3), or (views, 3, rows, columns) of a file; depth
    # (views, rows, columns) in metres, 0 without a ray; or codes with their dioptres.
    "join_rays": _RAYS | given(numbers="SlicingArguments") | write(fours="Squares"),
    # fours of join_rays; ranges (views, rows): the least and the largest depth of a row; views
    # (planes, views); used (planes, sheets, strips): a bit per layer with light; present (views,
    # rows of patches, patches of a row): whether any ray of PATCH_ROWS x PATCH_COLUMNS is there;
    # lens (planes, views, COLOURS, LENS_NODES, LENS_NODES): NODE by row and column, if LENS.
    "add_rays": _RAYS
    | given(numbers="SlicingArguments")
    | read(
        fours="Squares",
        ranges="float2",
        views="PlacedView",
        planes="FocusPlane",
        present="uchar",
        lens="float16",
    )
    | _SUMS,
    # rooms (rows, width): the weight of all rays per pixel; room_rows (LAYERS, height): the row of
    # rooms for each row of a layer; picture and reflections (height, width, 3); shown: sums of
    # specular rays.
    "compose": given(numbers="SlicingArguments")
    | read(rooms="float", room_rows="int", reflections="float", shown_used="int")
    | _SUMS
    | write(shown="sum4", picture="float"),
}
INTERFACE = SHARED | Interface(
    constants=CONSTANTS,
    records={
        "SlicingArguments": SLICING_ARGUMENTS, "PlacedView": PLACED_VIEW,
        "FocusPlane": FOCUS_PLANE, "Squares": SQUARES,
    },
    kernels=KERNELS,
)  # fmt: skip
"""What host and kernels share."""
FILES = ["refocus/kernels/depth/add_rays.cl", "refocus/kernels/depth/compose.cl"]
