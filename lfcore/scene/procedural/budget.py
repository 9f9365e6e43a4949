"""Meeting a triangle count exactly, with copies of one small part and cut-down remainders."""

from collections.abc import Callable

from lfcore.errors import SceneError
from lfcore.scene.procedural.basics import Parts
from lfcore.scene.surface_mesh import SurfaceMesh

MOST_TRIANGLES = 50_000_000


def fill_to(budget: int, unit: SurfaceMesh, make: Callable[[int], SurfaceMesh]) -> Parts:
    """``make(number)`` copies of ``unit``, cut off at ``budget`` triangles."""
    if budget > MOST_TRIANGLES:
        raise SceneError(
            f"more than {MOST_TRIANGLES} triangles are asked for",
            key="triangles",
            remedy="Ask for fewer triangles",
        )
    if budget < 0:
        raise SceneError(
            f"the model alone has {-budget} triangles more than asked for",
            key="triangles",
            remedy="Ask for more triangles",
        )
    if budget == 0:
        return []
    whole = make(-(-budget // unit.count))

    return [whole.picked(slice(budget))]
