"""Procedural models: a scene, or a thing to put into one, from parameters and a seed.

Each builder is a module with ``build(seed, **parameters) -> list[SurfaceMesh]``, whose parameters
have defaults; equal seeds and parameters give equal triangles and textures.
"""

import importlib
import inspect
from pathlib import Path
from typing import Any

from lfcore.errors import SceneError, did_you_mean
from lfcore.scene.surface_mesh import SurfaceMesh

BUILDERS = ("bedroom", "bike", "book", "cabin", "chart", "cornell", "ecosys", "sphere")


def build(
    name: str, parameters: dict, seed: int, *, file: str | Path | None = None, key: str = "objects"
) -> list[SurfaceMesh]:
    """The parts of builder ``name``, in world space."""
    if name not in BUILDERS:
        raise SceneError(
            f"unknown builder {name!r}", file=file, key=f"{key}.builder",
            remedy=did_you_mean(name, BUILDERS),
        )  # fmt: skip
    builder = importlib.import_module(f"{__name__}.{name}").build
    known = {
        parameter.name: parameter.default
        for parameter in inspect.signature(builder).parameters.values()
        if parameter.name != "seed"
    }
    for parameter, value in parameters.items():
        place = f"{key}.parameters.{parameter}"
        if parameter not in known:
            raise SceneError(
                f"builder {name!r} has no such parameter", file=file, key=place,
                remedy=did_you_mean(str(parameter), known),
            )  # fmt: skip
        _check_type(value, known[parameter], file, place)
    try:
        return builder(seed, **parameters)
    except SceneError as error:
        place = f"{key}.parameters.{error.key}" if error.key else f"{key}.parameters"
        raise error.named(SceneError, file=file, key=place) from None


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
