from .api import bake, load_scene, record, render, render_to_quality, trace_array
from .colour import exposed
from .datasets.description import Description
from .datasets.making import make_dataset
from .datasets.sample import sample_scene
from .datasets.stacks import Stacks
from .errors import (
    DeviceError,
    LfcoreError,
    OpticsError,
    SceneError,
    SettingsError,
    StorageError,
)
from .exchange.exporting import WriteOptions, export_lightfield
from .exchange.grid import Order
from .exchange.importing import ReadOptions, import_lightfield
from .exchange.source import Selection
from .exr import read_exr
from .lightfield import LightField
from .opencl.device import Device, open_device
from .optics.array import CameraArray
from .optics.camera import Camera
from .optics.dual_pixel import dual_pixel_disparity
from .optics.focus import DepthRange
from .optics.grid_geometry import Geometry
from .optics.lens import Lens
from .optics.planes import Aperture, SensorPlane
from .optics.slab import Extent, Lattice, Slab
from .pictures import write_picture
from .rendering.depth import disparity
from .rendering.quality import Quality, Rendering
from .rendering.truth import truth, write_truth
from .scene.appearance import Light, Material
from .scene.baked import BakedLight, BakeOptions
from .scene.model import Scene
from .scene.motion import Motion
from .scene.notes import Note
from .scene.surface_mesh import Surface
from .scene.view import View
from .sensor import Sensor
from .storage.codecs import Encoding
from .storage.depth_stream import StoredDepth
from .storage.metadata import Metadata
from .viewer.page import ViewerPage

__version__: str

__all__ = [
    "load_scene", "bake", "render", "render_to_quality", "record", "trace_array", "write_picture",
    "exposed", "import_lightfield", "export_lightfield", "open_device",
    "sample_scene", "make_dataset", "disparity", "dual_pixel_disparity", "truth", "write_truth",
    "read_exr",
    "LightField", "Scene", "Camera", "CameraArray", "SensorPlane", "Slab", "Lattice", "Quality",
    "Rendering", "Sensor", "Encoding", "Device", "ViewerPage",
    "Surface", "Material", "Light", "BakedLight", "BakeOptions", "Motion", "View", "Note",
    "DepthRange",
    "Aperture", "Lens", "Extent", "Geometry", "Selection", "Order", "ReadOptions", "WriteOptions",
    "Metadata", "StoredDepth", "Description", "Stacks",
    "LfcoreError", "SceneError", "OpticsError", "StorageError", "DeviceError", "SettingsError",
]  # fmt: skip
