"""pbrt's graphics state: transforms, attributes and their stack."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lfcore.scene.pbrt.lexer import Place, syntax_error
from lfcore.scene.pbrt.materials import Definition
from lfcore.scene.pbrt.parameters import ParameterSet
from lfcore.scene.transforms import rotate, scale, translate

START, END = 0, 1


@dataclass(frozen=True, eq=False)
class Attributes:
    """What AttributeBegin saves; ``matrices`` are the CTM at shutter open and close."""

    matrices: tuple[np.ndarray, np.ndarray] = field(default_factory=lambda: (np.eye(4), np.eye(4)))
    active: tuple[int, ...] = (START, END)
    material: Definition | None = None
    area_light: ParameterSet | None = None
    reversed: bool = False


class GraphicsState:
    """The current attributes with their stack and the named coordinate systems."""

    def __init__(self) -> None:
        self.now = Attributes()
        self._stack: list[tuple[str, Attributes, Place]] = []
        self.coordinate_systems: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    def push(self, kind: str, place: Place) -> None:
        self._stack.append((kind, self.now, place))

    def pop(self, kind: str, place: Place) -> None:
        """Raises :class:`SceneError` when ``kind`` is not the innermost open block."""
        if not self._stack or self._stack[-1][0] != kind:
            opened = f"{self._stack[-1][0]}Begin is open" if self._stack else "no block is open"
            raise syntax_error(f"{kind}End, but {opened}", place)
        _, saved, _ = self._stack.pop()
        if kind == "Transform":  # it saves the transform alone
            saved = replace(self.now, matrices=saved.matrices, active=saved.active)
        self.now = saved

    def check_closed(self) -> None:
        """Raises :class:`SceneError` at the first block that nothing closes."""
        if self._stack:
            kind, _, place = self._stack[0]
            raise syntax_error(f"{kind}Begin is never closed", place, f"Add {kind}End")

    def set(self, **changes: Any) -> None:
        self.now = replace(self.now, **changes)

    def concatenate(self, matrix: np.ndarray) -> None:
        """CTM = CTM * matrix, for the active times."""
        self._update(lambda current: current @ matrix)

    def assign(self, matrix: np.ndarray) -> None:
        self._update(lambda current: matrix)

    def _update(self, change: Callable[[np.ndarray], np.ndarray]) -> None:
        matrices = tuple(
            change(matrix) if time in self.now.active else matrix
            for time, matrix in enumerate(self.now.matrices)
        )
        self.set(matrices=matrices)

    def use_coordinate_system(self, name: str, place: Place) -> None:
        if name not in self.coordinate_systems:
            raise syntax_error(
                f'coordinate system "{name}" is not defined', place, "Use CoordinateSystem before"
            )
        self.set(matrices=self.coordinate_systems[name])


def transform_matrix(name: str, numbers: np.ndarray, place: Place) -> np.ndarray:
    """(4, 4) of a transform directive, as pbrt defines it."""
    if name == "Translate":
        return translate(*numbers)
    if name == "Scale":
        if not numbers.all():
            raise syntax_error(f"Scale by {numbers.tolist()} flattens space", place)
        return scale(*numbers)
    if name == "Rotate":
        if not numbers[1:].any():
            raise syntax_error("Rotate about an axis of no length", place)
        return rotate(numbers[1:].tolist(), numbers[0])
    if name == "LookAt":
        return look_at(numbers, place)
    matrix = numbers.reshape(4, 4).T  # files list columns
    if np.linalg.matrix_rank(matrix) < 4 or not np.allclose(matrix[3], [0, 0, 0, 1], atol=1e-9):
        raise syntax_error(f"{name} is not an invertible affine matrix", place)
    return matrix


def look_at(numbers: np.ndarray, place: Place) -> np.ndarray:
    """World to pbrt's left-handed camera space: x right, y up, z forward."""
    eye, target, up = numbers.reshape(3, 3)
    forward = target - eye
    if not forward.any():
        raise syntax_error("LookAt: eye and target coincide", place)
    forward = forward / np.linalg.norm(forward)
    right = np.cross(up, forward)
    if not np.linalg.norm(right) > 1e-12 * np.linalg.norm(up):
        raise syntax_error("LookAt: up is parallel to the view", place)
    right = right / np.linalg.norm(right)
    rows = np.stack([right, np.cross(forward, right), forward])
    matrix = np.eye(4)
    matrix[:3, :3] = rows
    matrix[:3, 3] = -rows @ eye
    return matrix
