"""Procedural models: a scene, or a thing to put into one, from parameters and a seed.

Each builder is a module with ``build(seed, **parameters) -> list[SurfaceMesh]``, whose parameters
have defaults; equal seeds and parameters give equal triangles and textures.
"""

from __future__ import annotations

import difflib
import importlib
import inspect
import re
from pathlib import Path
from typing import Any

from lfcore.errors import SceneError
from lfcore.scene.surface_mesh import SurfaceMesh

_COLOUR = re.compile("#[0-9a-fA-F]{6}")
BUILDERS = ("bedroom", "bike", "book", "cabin", "chart", "ecosys", "sphere")


def build(
    name: str, parameters: dict, seed: int, *, file: str | Path | None = None, key: str = "objects"
) -> list[SurfaceMesh]:
    """The parts of builder ``name``, in world space.

    Raises :class:`SceneError` for an unknown builder or parameter, or one of the wrong type.
    """
    if name not in BUILDERS:
        near = difflib.get_close_matches(name, BUILDERS, n=1)
        hint = f"Did you mean {near[0]!r}" if near else f"Builders are: {', '.join(BUILDERS)}"
        raise SceneError(f"unknown builder {name!r}", file=file, key=f"{key}.builder", remedy=hint)
    builder = importlib.import_module(f"{__name__}.{name}").build
    known = {
        parameter.name: parameter.default
        for parameter in inspect.signature(builder).parameters.values()
        if parameter.name != "seed"
    }
    for parameter, value in parameters.items():
        place = f"{key}.parameters.{parameter}"
        if parameter not in known:
            names = ", ".join(known) or "none"
            raise SceneError(
                f"builder {name!r} has no such parameter",
                file=file,
                key=place,
                remedy=f"Its parameters are: {names}",
            )
        _check_type(value, known[parameter], file, place)
    try:
        return builder(seed, **parameters)
    except SceneError as error:
        place = f"{key}.parameters.{error.key}" if error.key else f"{key}.parameters"
        raise SceneError(error.problem, file=file, key=place, remedy=error.remedy) from None


def _check_type(value: Any, default: object, file: str | Path | None, key: str) -> None:
    """A value must be of its default's type; whole numbers pass for floats, not booleans."""
    numeric = isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool)
    if type(value) is not type(default) and not numeric:
        raise SceneError(
            f"{value!r} is not of type {type(default).__name__}",
            file=file,
            key=key,
            remedy=f"Its default is {default!r}",
        )
    if isinstance(default, str) and default.startswith("#") and not _COLOUR.fullmatch(value):
        raise SceneError(
            f"{value!r} is no colour", file=file, key=key, remedy="Write #rrggbb in hexadecimal"
        )
