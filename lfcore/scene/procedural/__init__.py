"""Procedural models: a scene, or a thing to put into one, from parameters and a seed.

Each builder is a module with ``build(seed, **parameters) -> list[SurfaceMesh]``, whose parameters
have defaults; equal seeds and parameters give equal triangles and textures.
"""

import importlib
import inspect
from typing import Any

from lfcore.errors import SceneError, did_you_mean
from lfcore.reading import NOWHERE, Where
from lfcore.scene.surface_mesh import SurfaceMesh

BUILDERS = ("ball", "bedroom", "bike", "book", "cabin", "chart", "cornell", "ecosys", "sphere")


def build(name: str, parameters: dict, seed: int, where: Where = NOWHERE) -> list[SurfaceMesh]:
    """The parts of builder ``name``, in world space."""
    if name not in BUILDERS:
        raise where["builder"].error(f"unknown builder {name!r}", did_you_mean(name, BUILDERS))
    builder, place = importlib.import_module(f"{__name__}.{name}").build, where["parameters"]
    signature = inspect.signature(builder).parameters
    defaults = {key: parameter.default for key, parameter in signature.items()}
    del defaults["seed"]
    for key, value in parameters.items():
        if key not in defaults:
            problem = f"builder {name!r} has no such parameter"
            raise place[str(key)].error(problem, did_you_mean(str(key), defaults))
        _check_type(value, defaults[key], place[key])
    try:
        return builder(seed, **parameters)
    except SceneError as error:
        error_place = place[error.key] if error.key else place
        raise error_place.error(error.problem, error.remedy) from None


def _check_type(value: Any, default: object, where: Where) -> None:
    """A value must be of its default's type; whole numbers pass for floats, not booleans."""
    numeric = isinstance(default, float) and isinstance(value, int) and not isinstance(value, bool)
    if type(value) is not type(default) and not numeric:
        problem = f"{value!r} is not of type {type(default).__name__}"
        raise where.error(problem, f"Its default is {default!r}")
