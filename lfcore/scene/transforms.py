"""4x4 matrices from the ``transform`` lists and camera poses of scene files (float64)."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lfcore.reading import NOWHERE, Where

Vector = Sequence[float]


def affine(linear: ArrayLike, offset: ArrayLike = 0.0) -> np.ndarray:
    """(4, 4) of a (3, 3) linear part and what is then added (3,)."""
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, offset
    return matrix


def translate(x: float, y: float, z: float) -> np.ndarray:
    return affine(np.eye(3), (x, y, z))


def scale(x: float, y: float | None = None, z: float | None = None) -> np.ndarray:
    """Uniform with one argument, else per axis."""
    return np.diag([x, x if y is None else y, x if z is None else z, 1.0]).astype(np.float64)


def rotate(axis: Vector | str, angle_deg: float) -> np.ndarray:
    """Right-handed rotation by ``angle_deg`` about ``axis`` (a vector, or x, y, z)."""
    if isinstance(axis, str):
        axis = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1)}[axis]
    x, y, z = np.asarray(axis, np.float64) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.radians(angle_deg)
    return affine(np.eye(3) + (math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross)))


def chain(*steps: np.ndarray) -> np.ndarray:
    """One matrix that applies the steps in the order given."""
    matrix = np.eye(4)
    for step in steps:
        matrix = step @ matrix
    return matrix


def parse_transform(steps: list[dict], where: Where) -> np.ndarray:
    """The matrix of a schema-checked ``transform`` list, applied from first to last."""
    matrices = []
    for index, step in enumerate(steps):
        ((kind, value),) = step.items()
        here = where[index][kind]
        if kind == "translate_m":
            matrices.append(translate(*value))
        elif kind == "scale":
            matrices.append(scale(*value) if isinstance(value, list) else scale(value))
        elif kind == "rotate":
            axis = value["axis"]
            if not isinstance(axis, str) and not any(axis):
                raise here["axis"].error("rotation axis has no length")
            matrices.append(rotate(axis, value["angle_deg"]))
        else:
            matrices.append(parse_matrix(value, here))
    return chain(*matrices)


def parse_matrix(rows: Sequence[Vector], where: Where) -> np.ndarray:
    """A 4x4 matrix whose last row must be 0 0 0 1 and which must be invertible."""
    matrix = np.array(rows, np.float64)
    if not np.array_equal(matrix[3], [0, 0, 0, 1]):
        remedy = "Give an affine matrix in row-major order, last row [0, 0, 0, 1]"
        raise where.error(f"last row is {matrix[3].tolist()}", remedy)
    if np.linalg.matrix_rank(matrix[:3, :3]) < 3:
        raise where.error("matrix flattens space", "Give an invertible matrix")
    return matrix


def look_at(
    position: Vector, target: Vector, up: Vector = (0.0, 1.0, 0.0), where: Where = NOWHERE
) -> np.ndarray:
    """World to camera space (x right, y down, z forward) of a camera at ``position``."""
    centre = np.asarray(position, np.float64)
    forward = np.asarray(target, np.float64) - centre
    if not np.linalg.norm(forward) > 0:
        raise where.error("position_m and look_at_m coincide", "Move one of them")
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, np.asarray(up, np.float64))
    if not np.linalg.norm(right) > 1e-9 * np.linalg.norm(up):
        remedy = "Give another up, for example [0, 0, 1] when looking down"
        raise where["up"].error("up is parallel to the viewing direction", remedy)
    right /= np.linalg.norm(right)
    return rigid_to_camera(np.stack([right, np.cross(forward, right), forward]), centre)


def rigid_to_camera(rows: np.ndarray, position: np.ndarray) -> np.ndarray:
    """World-to-camera matrix from its (3, 3) rotation and the lens centre in the world."""
    return affine(rows, -rows @ position)


def pose_from_matrix(rows: Sequence[Vector], where: Where) -> np.ndarray:
    """World to camera from a camera-to-world matrix in the file's convention.

    The camera looks along its own -z with +y up, as in glTF and OpenGL; scale is refused.
    """
    to_world = parse_matrix(rows, where)
    rotation = to_world[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-4) or np.linalg.det(rotation) < 0:
        remedy = "Give a rigid camera-to-world matrix without scale, shear or mirroring"
        raise where.error("the upper left 3x3 block is not a rotation", remedy)
    return rigid_to_camera(np.diag([1.0, -1.0, -1.0]) @ rotation.T, to_world[:3, 3])
