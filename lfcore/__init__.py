"""Synthetic light fields: trace a light slab, store it, refocus it, measure it.

Data flows one way: scene -> rays -> light field -> pictures -> numbers.  A package imports
only those on its left: ``scene``, ``optics``, ``opencl``, ``tracing``, ``storage``,
``refocus``, ``evaluation``.  ``oracle`` holds slow float64 references for tests and reports.
"""

from importlib import import_module

__version__ = "0.1.0"

_LAZY = {
    "LightField": "lfcore.lightfield",
    "SensorPlane": "lfcore.optics.planes",
    "Slab": "lfcore.optics.slab",
    "Camera": "lfcore.optics.camera",
    "Tracer": "lfcore.tracing.tracer",
    "LfcoreError": "lfcore.errors",
}


def __getattr__(name: str):
    """Public names, imported when first asked for: ``import lfcore`` alone loads no driver."""
    if name in _LAZY:
        # By a string: whoever reads imports to find what a module depends on is not misled.
        return getattr(import_module(_LAZY[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *_LAZY])
