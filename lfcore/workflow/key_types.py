"""What the configuration's keys are written with: kinds of values, and mappings of keys."""

from __future__ import annotations

import copy
from typing import Annotated, Any, Literal

import yaml
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    model_serializer,
)
from pydantic_core import PydanticCustomError


class Keys(BaseModel):
    """Keys of one mapping; others are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, validate_default=True)


class GivenKeys(Keys):
    """Keys of which only those that were given are passed on."""

    model_config = ConfigDict(validate_default=False)

    @model_serializer
    def _given(self) -> dict[str, Any]:
        return {
            name: getattr(self, name)
            for name in type(self).model_fields
            if name in self.model_fields_set
        }


def _meant(value: object) -> object:
    """Snakemake hands over what is within lists and mappings of ``--config`` as text."""
    if isinstance(value, str):
        try:
            meant = yaml.safe_load(value)
        except (yaml.YAMLError, ValueError, RecursionError):
            return value
        return meant if meant is None or isinstance(meant, (bool, int, float)) else value
    return value


def _number(value: object) -> object:
    value = _meant(value)
    if isinstance(value, bool) or (value is None):
        raise PydanticCustomError("no_number", "is no number")
    return value


def _distinct(values: list) -> list:
    if any(value in values[:place] for place, value in enumerate(values)):
        raise PydanticCustomError("repeated", "has an entry twice")
    return values


Truth = Annotated[bool, BeforeValidator(_meant)]


def _name(value: object) -> object:
    """AV1's presets are numbers, and None is text on the command line."""
    if isinstance(value, int) and not isinstance(value, bool):
        return str(value)
    return None if value == "null" else value


Name = Annotated[str, BeforeValidator(_name)]
NameOrNone = Annotated[str | None, BeforeValidator(_name)]


def whole(low: int, high: int) -> Any:
    """A whole number from ``low`` to ``high``."""
    return Annotated[int, Field(ge=low, le=high), BeforeValidator(_number)]


class _OneNumber:
    """Of a number's schema: whole ones are numbers."""

    def __get_pydantic_json_schema__(self, schema: Any, handler: Any) -> dict[str, Any]:
        return handler(schema)["anyOf"][-1]


def number(**bounds: Any) -> Any:
    """A number within pydantic's bounds; whole ones stay whole."""
    field = Field(**bounds)
    kinds = Annotated[int, field] | Annotated[float, field]
    return Annotated[kinds, BeforeValidator(_number), _OneNumber()]


def real(low: float, high: float) -> Any:
    """A number from ``low`` to ``high``."""
    return number(ge=low, le=high)


def several(item: Any, least: int = 1, most: int | None = None) -> Any:
    """A list of distinct items."""
    field = Field(min_length=least or None, max_length=most)
    return Annotated[list[item], AfterValidator(_distinct), field]


def listed(item: Any, least: int, most: int | None = None) -> Any:
    """A list of items, which may repeat."""
    return Annotated[list[item], Field(min_length=least or None, max_length=most)]


def choices(*names: str) -> Any:
    """A list of some of these names."""
    return several(Literal[names], 0)


def key(meaning: str, default: Any = ...) -> Any:
    """A key's meaning and default; lists and mappings are copied."""
    if isinstance(default, (list, dict)):
        return Field(description=meaning, default_factory=lambda: copy.deepcopy(default))
    return Field(default, description=meaning)


def group(model: type[Keys], meaning: str) -> Any:
    """A mapping of keys, all of which have defaults."""
    return Annotated[model, Field(description=meaning, default_factory=model)]
