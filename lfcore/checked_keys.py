"""Mistakes in mappings of keys that pydantic checks, in words for the user."""

import re
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from pydantic import BaseModel, ValidationError

from lfcore.errors import SettingsError, did_you_mean

SHORT = 80
"""The characters of a value that an error repeats."""
OTHER_KIND = ("_type", "_parsing", "literal_error", "pattern_mismatch")
"""Ends of the names of errors that say that a value is of another kind."""


def refusal(model: type[BaseModel], error: ValidationError, **where: Any) -> SettingsError:
    """The error of the first mistake in the keys of ``model``, with its place.

    ``where`` are ``file`` and ``key``, in which the model's keys are.
    """
    mistakes = error.errors()
    first = max(mistakes, key=lambda mistake: len(mistake["loc"]))
    place, meaning, known = _place(model, first)
    alternatives = [mistake for mistake in mistakes if _place(model, mistake)[0] == place]
    if len(alternatives) > 1:
        meant = [mistake for mistake in alternatives if not mistake["type"].endswith(OTHER_KIND)]
        first = meant[0] if meant else first | {"type": "none of them"}
    shown = str(first["input"])
    shown = repr(shown if len(shown) < SHORT else f"{shown[:SHORT]}...")
    problem, remedy = f"{shown}: {first['msg']}", f"The key is: {meaning}" if meaning else None
    problem = problem.replace("Input should be", "must be").replace("Value error, ", "")
    match first["type"]:
        case "extra_forbidden":
            problem, remedy = "unknown key", did_you_mean(place[-1], known)
        case "literal_error":
            names = re.findall(r"'([^']*)'", first["ctx"]["expected"])
            problem, remedy = f"{shown} is unknown", did_you_mean(str(first["input"]), names)
        case "none of them":
            problem = f"{shown} is not a value of this key"
        case "missing":
            problem = "is missing"
        case "value_error" if isinstance(first["input"], Mapping):  # of several keys
            problem = first["msg"].removeprefix("Value error, ")
    key = ".".join(place)[:200]
    if "key" in where:
        key = f"{where['key']}: {key}" if key else where["key"]
    return SettingsError(problem, **where | {"key": key or None}, remedy=remedy)


def _place(model: Any, mistake: Any) -> tuple[list[str], str, list[str]]:
    """The path of a mistake's key, the key's meaning, and the keys of the mapping it is in."""
    path, meaning, known = [], "", list(model.model_fields)
    for depth, part in enumerate(mistake["loc"], 1):
        fields = getattr(model, "model_fields", {})
        if part in fields:
            meaning = fields[part].description or ""
            model = next(_models(fields[part].annotation), None)
        elif mistake["type"] == "extra_forbidden" and depth == len(mistake["loc"]):
            known = list(fields)
        elif not isinstance(part, int):
            continue  # an alternative of a union
        path.append(str(part))
    return path, meaning, known


def _models(annotation: Any) -> Iterator[type[BaseModel]]:
    """The models within an annotation."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        yield annotation
    for part in get_args(annotation):
        yield from _models(part)
