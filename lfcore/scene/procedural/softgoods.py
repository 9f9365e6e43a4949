"""Cloth and stuffing: pillows, draped blankets, curtains, tufted panels, rugs, a teddy bear."""

import numpy as np

from lfcore.scene.procedural import textures
from lfcore.scene.procedural.basics import Parts, Range, Size
from lfcore.scene.procedural.primitives import mesh_grid, scattered
from lfcore.scene.procedural.turned import curve, sphere, tube
from lfcore.scene.surface_mesh import Surface, SurfaceMesh, crease_normals, join, transform_all, xyz
from lfcore.scene.transforms import chain, rotate, scale, translate

Triple = tuple[float, float, float]


def pillow(size: Triple, surface: Surface, *, seed: int, pieces: int) -> SurfaceMesh:
    """Two sheets sewn along a seam, lying in the plane y = 0; 4 * pieces^2 triangles."""
    width, thick, deep = size
    edge = np.sin(np.linspace(-np.pi / 2, np.pi / 2, pieces + 1))
    u, v = np.meshgrid(edge, edge)
    body = np.maximum((1 - np.abs(u) ** 2.4) * (1 - np.abs(v) ** 2.4), 0) ** 0.42
    wrinkle = textures.noise(seed, cells=(5, 5), octaves=3, size=u.shape) - 0.5
    radial = np.sin(np.arctan2(v, u) * 14 + 5 * wrinkle) * np.clip(u**2 + v**2 - 0.35, 0, 1)
    height = body * (1 + 0.10 * wrinkle) + 0.05 * radial * body**0.5
    x = u * (1 - 0.10 * (1 - v**2) * np.abs(u) ** 3) * width / 2
    z = v * (1 - 0.10 * (1 - u**2) * np.abs(v) ** 3) * deep / 2
    sheets = [xyz(x, side * height * thick / 2, z) for side in (1.0, -1.0)]
    uv = np.stack([x, z], -1) * 2.0
    return join([mesh_grid(points, surface, uv, crease_deg=180) for points in sheets])


def _over_edge(excess: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The offsets outward and down of cloth that passes an edge by ``excess``."""
    radius = 0.07
    angle = np.clip(excess / radius, 0, np.pi / 2)
    straight = np.maximum(excess - radius * np.pi / 2, 0)
    return radius * np.sin(angle), radius * (1 - np.cos(angle)) + straight


def draped(
    width: float,
    length: float,
    drop: Range,
    surface: Surface,
    seed: int,
    pieces: Size,
    repeat: float,
    wrinkle: float,
) -> SurfaceMesh:
    """A blanket over a block ``width`` (x) by ``length`` (z, from 0), top at y = 0.

    It hangs down by ``drop[0]`` on both sides and ``drop[1]`` beyond ``length``, in folds.
    """
    a = np.linspace(-width / 2 - drop[0], width / 2 + drop[0], pieces[0] + 1)
    b = np.linspace(0, length + drop[1], pieces[1] + 1)
    across, along = np.meshgrid(a, b)
    side_out, side_down = _over_edge(np.maximum(np.abs(across) - width / 2, 0))
    foot_out, foot_down = _over_edge(np.maximum(along - length, 0))
    broad = textures.noise(seed, cells=(5, 5), octaves=3, size=across.shape) - 0.5
    fine = textures.noise(seed + 1, cells=(4, 7), octaves=3, size=across.shape)
    crease = 1 - np.abs(2 * fine - 1)
    down = np.maximum(side_down, foot_down) + 0.35 * np.minimum(side_down, foot_down)
    flat = np.exp(-((down / 0.06) ** 2))
    fold = 0.30 * down / max(*drop)
    side_fold = fold * (0.16 * np.sin(15 * along + 5 * broad) + 0.08 * np.sin(31 * along + 3))
    foot_fold = fold * (0.16 * np.sin(14 * across + 5 * broad) + 0.08 * np.sin(27 * across + 1))
    x = np.clip(across, -width / 2, width / 2) + np.sign(across) * (side_out + side_fold)
    z = np.minimum(along, length) + foot_out + foot_fold
    y = -down + flat * wrinkle * (2.2 * broad + 1.4 * crease**6)
    uv = np.stack([across, -along], -1) * repeat
    return mesh_grid(xyz(x, y, z), surface, uv, crease_deg=180)


def curtain(
    width: float, height: float, surface: Surface, *, seed: int, pull: float,
    pieces: tuple[int, int] = (130, 30),
) -> SurfaceMesh:  # fmt: skip
    """Hangs from y = ``height`` along +x, pleats along z; drawn in at the height of its tie.

    ``pull`` +1 draws it to its left end, -1 to its right.
    """
    s, t = np.meshgrid(*(np.linspace(0, 1, n + 1) for n in pieces))
    level, tied = 0.42, 0.45  # the height of the tie, and the width there
    waist = np.exp(-(((t - level) / 0.22) ** 2))
    spread = 1 - (1 - tied) * waist - 0.25 * (t < level) * (1 - waist) * (1 - tied)
    anchor = 0.0 if pull > 0 else 1.0
    x = (anchor + (s - anchor) * spread) * width
    sway = textures.noise(seed, cells=(2, 3), octaves=2, size=s.shape) - 0.5
    phase = 2 * np.pi * 9 * s + 1.6 * sway
    depth = (0.030 + 0.022 * (1 - t)) * (1 - 0.35 * waist)
    z = depth * (np.sin(phase) + 0.25 * np.sin(2 * phase + 1)) + 0.03 * sway * (1 - t)
    uv = np.stack([s * width * 2.2, t * height], -1) * 1.4
    return mesh_grid(xyz(x, t * height, z), surface, uv, crease_deg=180)


def tufted(width: float, height: float, surface: Surface) -> SurfaceMesh:
    """An upholstered panel in the plane z = 0, buttoned in diamonds, with rounded edges."""
    u, v = np.meshgrid(np.linspace(0, 1, 111), np.linspace(0, 1, 61))
    nx, ny = 7, max(2, round(7 * height / width))
    p, q = u * nx + v * ny, u * nx - v * ny
    soft = np.abs(np.sin(np.pi * p / 1.0) * np.sin(np.pi * q / 1.0)) ** 0.45
    rim = np.minimum.reduce([u * width, (1 - u) * width, v * height, (1 - v) * height])
    round_off = np.sqrt(np.clip(1 - (1 - np.clip(rim / 0.05, 0, 1)) ** 2, 0, 1))
    z = 0.075 * round_off * (0.55 + 0.45 * soft)
    top = v * height * (1 + 0.10 * (1 - (2 * u - 1) ** 2) * v)
    uv = np.stack([u * width, v * height], -1) * 2.0
    return mesh_grid(xyz((u - 0.5) * width, top, z), surface, uv, crease_deg=180)


def rug(width: float, depth: float, field: Surface, fringe: Surface, *, seed: int) -> Parts:
    """A woven rug on the floor, gently wavy, with a fringe at both ends along x."""
    rng = np.random.default_rng(seed)
    u, v = np.meshgrid(np.linspace(0, 1, 61), np.linspace(0, 1, 41))
    wave = textures.noise(seed, cells=(3, 3), octaves=2, size=u.shape)
    lift = 0.010 + 0.010 * wave
    border = (u == 0) | (u == 1) | (v == 0) | (v == 1)
    points = xyz((u - 0.5) * width, np.where(border, 0.001, lift), (0.5 - v) * depth)
    parts = [mesh_grid(points, field, np.stack([u, v], -1), crease_deg=180)]
    path = [(0, 0.012, 0), (0.02, 0.014, 0.002), (0.05, 0.006, 0.004), (0.085, 0.004, -0.004)]
    knot = tube(curve(path, 5), [0.006, 0.008, 0.006, 0.007, 0.004], fringe, segments=5)
    number = int(depth / 0.024)
    for side in (rotate("y", 0.0), rotate("y", 180.0)):
        ends = [
            translate(width / 2, 0, (k + 0.5) / number * depth - depth / 2) for k in range(number)
        ]
        matrices = [chain(rotate("y", rng.uniform(-22, 22)), end, side) for end in ends]
        parts.append(scattered(knot, np.array(matrices)))
    return parts


def fluffy(base: SurfaceMesh, *, seed: int, depth: float) -> SurfaceMesh:
    """Plush: the part's vertices moved along their normals by noise that is the same everywhere."""
    pile = textures.noise(seed, cells=(36, 36), octaves=2, size=(256, 256)) - 0.5
    assert base.uvs is not None and base.normals is not None
    u, v = base.uvs[..., 0] % 1, np.clip(base.uvs[..., 1], 0, 1)
    offset = pile[(v * 255).astype(int), (u * 256).astype(int) % 256]
    offset = offset * np.sin(np.pi * v)  # the poles of a sphere are many texels wide
    triangles = base.triangles + depth * offset[..., None] * base.normals
    triangles = np.round(triangles, 7)
    return SurfaceMesh(triangles, base.surface, crease_normals(triangles, 180.0), base.uvs)


def teddy(fur: Surface, light: Surface, dark: Surface, *, seed: int) -> Parts:
    """A sitting bear, 0.45 m tall, facing +z."""

    def lump(
        radius: Triple, centre: Triple, surface: Surface = fur, detail: float = 1.0
    ) -> SurfaceMesh:
        ball = sphere(radius, surface, segments=int(40 * detail), rings=int(26 * detail))
        if surface is not dark:
            ball = fluffy(ball, seed=seed, depth=0.012)
        return ball.at(*centre)

    parts = [
        lump((0.115, 0.13, 0.10), (0, 0.14, 0)),
        lump((0.078, 0.088, 0.03), (0, 0.135, 0.082), light, 0.7),
        lump((0.105, 0.095, 0.092), (0, 0.325, 0.015)),
        lump((0.046, 0.036, 0.036), (0, 0.300, 0.095), light, 0.6),
        lump((0.015, 0.011, 0.009), (0, 0.316, 0.130), dark, 0.4),
    ]
    for side in (-1, 1):
        parts += [
            lump((0.036, 0.036, 0.018), (0.082 * side, 0.405, 0.0), fur, 0.7),
            lump((0.023, 0.023, 0.010), (0.082 * side, 0.404, 0.015), light, 0.4),
            lump((0.0095, 0.0105, 0.007), (0.038 * side, 0.343, 0.102), dark, 0.4),
        ]
        arm = lump((0.040, 0.090, 0.040), (0, -0.07, 0), fur, 0.8)
        place = translate(0.10 * side, 0.23, 0.02)
        parts.append(arm.transformed(rotate("x", -42), rotate("z", 34 * side), place))
        leg = lump((0.050, 0.050, 0.095), (0, 0, 0.08), fur, 0.8)
        sole = lump((0.038, 0.040, 0.010), (0, 0.005, 0.172), light, 0.5)
        parts += transform_all(
            [leg, sole], rotate("y", 24 * side), translate(0.075 * side, 0.05, 0.03)
        )
    return transform_all(parts, scale(1.05))
