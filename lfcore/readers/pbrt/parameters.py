"""The parameter lists ``"type name" [values]`` of pbrt directives, checked and typed."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lfcore.errors import SceneError, did_you_mean
from lfcore.readers.pbrt.lexer import Place
from lfcore.scene.notes import APPROXIMATED, LEFT_OUT, NOT_USED, Notebook

COLOUR_TYPES = ("rgb", "color", "spectrum", "blackbody", "xyz")
_POINTS = ("point", "point3", "vector", "vector3", "normal", "normal3")
_PAIRS = ("point2", "vector2")
NUMERIC_TYPES = ("integer", "float", "rgb", "color", "xyz", "blackbody", *_POINTS, *_PAIRS)
TYPES = (*NUMERIC_TYPES, "spectrum", "bool", "string", "texture")


@dataclass(eq=False)
class Parameter:
    """A parameter; ``values`` is a float64 array for numeric types, else a list of str or bool."""

    type: str
    name: str
    values: Any
    place: Place
    used: bool = False


@dataclass
class ParameterSet:
    """The parameters of one directive; a parameter that is read is marked as used."""

    owner: str  # e.g. 'Shape "sphere"', for messages
    place: Place
    notebook: Notebook
    items: dict[str, Parameter] = field(default_factory=dict)

    def get(self, name: str, *types: str) -> Parameter | None:
        """Return a parameter and mark it as used; None if it is absent."""
        parameter = self.items.get(name)
        if parameter is None:
            return None
        if types and parameter.type not in types:
            expected, actual = " or ".join(types), parameter.type
            problem = f'{self.owner} wants "{name}" as {expected}, not "{actual}"'
            raise parameter.place.error(problem, f'Write "{types[0]} {name}"')
        parameter.used = True
        return parameter

    def _rows(self, name: str, width: int, *types: str) -> np.ndarray | None:
        """Return a parameter with one of these types as (n, ``width``) float64."""
        parameter = self.get(name, *types)
        if parameter is None:
            return None
        if len(parameter.values) % width:
            raise self.wrong_count(parameter, f"a multiple of {width}")
        return parameter.values.reshape(-1, width)

    def vectors(self, name: str) -> np.ndarray | None:
        """Return a point, vector or normal parameter as (n, 3) float64."""
        return self._rows(name, 3, *_POINTS)

    def pairs(self, name: str) -> np.ndarray | None:
        """Return a point2, vector2 or float parameter as (n, 2) float64."""
        return self._rows(name, 2, "float", *_PAIRS)

    def floats(self, name: str, count: int | None = None) -> np.ndarray | None:
        """Return the numbers of a float or integer parameter, float64; there must be ``count``."""
        parameter = self.get(name, "float", "integer")
        if parameter is not None and count not in (None, len(parameter.values)):
            raise self.wrong_count(parameter, str(count))
        return None if parameter is None else parameter.values

    def vector(self, name: str, default: ArrayLike) -> np.ndarray:
        values = self.vectors(name)
        if values is not None and len(values) != 1:
            raise self.error(name, "must be 3 numbers")
        return np.array(default, np.float64) if values is None else values[0]

    def float(self, name: str, default: float) -> float:
        values = self.floats(name, 1)
        return default if values is None else float(values[0])

    def integer(self, name: str, default: int) -> int:
        value = self.float(name, default)
        if value != int(value):
            raise self.error(name, f"must be a whole number, not {value}")
        return int(value)

    def indices(self, name: str) -> np.ndarray | None:
        """Return a parameter's whole numbers, int64."""
        values = self.floats(name)
        if values is None:
            return None
        with np.errstate(invalid="ignore"):
            whole = values.astype(np.int64)
        if not np.array_equal(whole, values):
            raise self.error(name, "must be whole numbers")
        return whole

    def bool(self, name: str, default: bool) -> bool:
        parameter = self.get(name, "bool")
        return default if parameter is None else bool(parameter.values[0])

    def string(self, name: str, default: str | None = None) -> Any:
        parameter = self.get(name, "string")
        if parameter is not None and len(parameter.values) != 1:
            raise self.wrong_count(parameter, "one string")
        return default if parameter is None else parameter.values[0]

    def error(self, name: str, problem: str, remedy: str | None = None) -> SceneError:
        """Return a :class:`SceneError` at the parameter, or at the directive if it is absent."""
        return self.place_of(name).error(f'"{name}" of {self.owner} {problem}', remedy)

    def place_of(self, name: str) -> Place:
        """Return the place of a parameter, or of the directive if it is absent."""
        return self.items[name].place if name in self.items else self.place

    def note(self, kind: str, words: str, name: str = "") -> None:
        """Record a note at the place of the parameter ``name``, or of the directive."""
        self.notebook.add(kind, self.place_of(name), words)

    def approximated(self, how: str, name: str = "") -> None:
        """Record how the directive is replaced, at the place as in :meth:`note`."""
        self.note(APPROXIMATED, f"{self.owner}: {how}", name)

    def left_out(self, part: str) -> None:
        """Record a part of the directive that is not mapped."""
        self.note(LEFT_OUT, f"{part} of {self.owner}")

    def wrong_count(self, parameter: Parameter, expected: str) -> SceneError:
        return self.error(parameter.name, f"has {len(parameter.values)} values, wants {expected}")

    def note_unused(self) -> None:
        """Record the parameters that nobody read."""
        for name, parameter in self.items.items():
            if not parameter.used:
                self.note(NOT_USED, f'parameter "{name}" of {self.owner}', name)


def declare(text: str, place: Place) -> tuple[str, str]:
    """Split ``"type name"``.  Raises :class:`SceneError` for an unknown type."""
    words = text.split()
    if len(words) != 2:
        remedy = 'Write "type name", for example "float fov"'
        raise place.error(f'"{text}" is not a parameter', remedy)
    if words[0] not in TYPES:
        remedy = did_you_mean(words[0], TYPES)
        raise place.error(f"unknown parameter type {words[0]!r}", remedy)
    return words[0], words[1]
