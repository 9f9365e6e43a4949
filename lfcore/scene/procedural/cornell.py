"""A Cornell box: two blocks in a white room with a red and a green wall, under a lamp.

After C. Goral, K. Torrance, D. Greenberg and B. Battaile, "Modeling the Interaction of Light
Between Diffuse Surfaces", SIGGRAPH 1984.
"""

from lfcore.scene.procedural.basics import Parts, painted
from lfcore.scene.procedural.primitives import box, rectangle
from lfcore.scene.surface_mesh import transform_all
from lfcore.scene.transforms import rotate, translate

SIDE, LAMP = 5.5, (16.0, 12.0, 6.7)


def build(seed: int) -> Parts:
    """46 triangles in a cube of 5.5 m from x, y = 0 and z = -5.5, open towards +z.

    ``seed`` changes nothing: the box has no random part.
    """
    white, red = painted("white", "#dcd8cf"), painted("red", "#a81f1c")
    green = painted("green", "#2c7f31")
    glow = painted("lamp", "#c8c8c8", emission=LAMP)
    s = SIDE
    parts = [
        rectangle((0, 0, 0), (s, 0, 0), (0, 0, -s), white),
        rectangle((0, s, -s), (s, 0, 0), (0, 0, s), white),
        rectangle((0, 0, -s), (s, 0, 0), (0, s, 0), white),
        rectangle((0, 0, 0), (0, 0, -s), (0, s, 0), red),
        rectangle((s, 0, -s), (0, 0, s), (0, s, 0), green),
        box((1.3, 0.02, 1.0), glow).at(s / 2, s - 0.01, -s / 2),
    ]
    for size, turn, x, z in (((1.65, 3.3, 1.65), 17, 1.85, -3.5), ((1.65,) * 3, -18, 3.7, -1.7)):
        block = [box(size, white).at(0, size[1] / 2, 0)]
        parts += transform_all(block, rotate("y", turn), translate(x, 0, z))
    return parts
