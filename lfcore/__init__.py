"""Synthetic light fields: trace a light slab, store it, refocus it, measure it.

    import lfcore

    scene = lfcore.load_scene("model.glb")
    picture = lfcore.render(scene, focus_m=3.2, f_number=2)
    field = lfcore.record(scene, "model.mkv", views=32, pixels=512, f_number=2)
    near = field.refocus(focus_m=2.0)

Everything public is named here.  Of the packages below, each imports only those on its left:
``optics``, ``scene``, ``opencl``, ``tracing``, ``storage``, ``refocus``, ``rendering``, then the
modules ``lightfield`` and ``api``, then ``exchange``, ``evaluation`` and ``cli``: .importlinter
lists all, and is checked.  ``oracle`` holds slow float64 references for tests and reports.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from lfcore.api import load_scene, record, render, render_to_quality, trace_array
    from lfcore.errors import DeviceError, LfcoreError, OpticsError, SceneError, StorageError
    from lfcore.exchange import export_lightfield, import_lightfield
    from lfcore.lightfield import LightField
    from lfcore.opencl.device import Device, open_device
    from lfcore.optics.array import CameraArray
    from lfcore.optics.camera import Camera
    from lfcore.optics.focus import DepthRange
    from lfcore.optics.lattice import Lattice
    from lfcore.optics.planes import SensorPlane
    from lfcore.optics.slab import Slab
    from lfcore.pictures import write_picture
    from lfcore.rendering.quality import Quality, Rendering
    from lfcore.scene.appearance import Light
    from lfcore.scene.model import Scene
    from lfcore.scene.surface_mesh import Surface
    from lfcore.storage.codecs import Encoding
    from lfcore.tracing.tracer import Tracer

__version__ = "0.1.0"

__all__ = [
    "load_scene", "render", "render_to_quality", "record", "trace_array",
    "import_lightfield", "export_lightfield",
    "write_picture", "open_device",
    "LightField", "Scene", "Surface", "Light", "Camera", "CameraArray", "DepthRange", "SensorPlane",
    "Slab",
    "Encoding", "Lattice", "Quality", "Rendering", "Device", "Tracer",
    "LfcoreError", "SceneError", "OpticsError", "StorageError", "DeviceError",
]  # fmt: skip

_HOMES = {
    "api": ("load_scene", "render", "render_to_quality", "record", "trace_array"),
    "errors": ("LfcoreError", "SceneError", "OpticsError", "StorageError", "DeviceError"),
    "exchange": ("import_lightfield", "export_lightfield"),
    "lightfield": ("LightField",),
    "opencl.device": ("Device", "open_device"),
    "optics.array": ("CameraArray",),
    "optics.camera": ("Camera",),
    "optics.focus": ("DepthRange",),
    "optics.lattice": ("Lattice",),
    "optics.planes": ("SensorPlane",),
    "optics.slab": ("Slab",),
    "pictures": ("write_picture",),
    "scene.appearance": ("Light",),
    "scene.model": ("Scene",),
    "scene.surface_mesh": ("Surface",),
    "rendering.quality": ("Quality", "Rendering"),
    "storage.codecs": ("Encoding",),
    "tracing.tracer": ("Tracer",),
}
_HOME_OF = {name: f"{__name__}.{module}" for module, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> object:
    """Public names, imported when first asked for: ``import lfcore`` alone loads no driver."""
    if name in _HOME_OF:
        return getattr(import_module(_HOME_OF[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
