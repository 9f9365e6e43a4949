"""For all tests: the OpenCL devices found. What asks for ``device`` runs on each of them,
or on those that LFCORE_DEVICE names."""

import os

# Before numpy is there: BLAS threads of one process for each core would wait for one another by
# spinning, and the float64 references then take minutes on a busy machine.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import hypothesis
import pytest
import yaml

from lfcore import DeviceError
from lfcore.opencl.device import all_devices, is_named, name_of, open_device

# A test that waits for a core of a busy machine has not failed.
hypothesis.settings.register_profile("patient", deadline=None)
hypothesis.settings.load_profile("patient")

try:
    CHOSEN = os.environ.get("LFCORE_DEVICE")
    DEVICES = [name_of(one) for one in all_devices() if is_named(one, CHOSEN)]
    MISSING = ""
except DeviceError as error:
    DEVICES, MISSING = [], str(error)


COSTLY = ("workflow", "slow", "browser", "kernels")


def pytest_collection_modifyitems(items):
    """Files of costly tests come first, so that no process is left alone with one at the end."""
    place = {}
    for item in items:
        marks = [COSTLY.index(name) for name in COSTLY if item.get_closest_marker(name)]
        place[item.path] = min(place.get(item.path, len(COSTLY)), *marks, len(COSTLY))
    items.sort(key=lambda item: place[item.path])


def pytest_report_header(config):
    return f"OpenCL devices: {', '.join(DEVICES) or MISSING}"


@pytest.fixture(
    scope="session", params=DEVICES or [pytest.param(None, marks=pytest.mark.skip(reason=MISSING))]
)
def device(request):
    """An open device; a test that takes it is named for the device it ran on."""
    return open_device(request.param)


# -- small scenes and meshes on disk ---------------------------------------------

TETRAHEDRON = """\
v 0 0 0
v 1 0 0
v 0 1 0
v 0 0 1
f 1 3 2
f 1 2 4
f 1 4 3
f 2 3 4
"""


@pytest.fixture
def tetrahedron(tmp_path):
    """An OBJ of four triangles."""
    path = tmp_path / "tetrahedron.obj"
    path.write_text(TETRAHEDRON)
    return path


@pytest.fixture
def write_scene(tmp_path):
    """A function that writes a description as scene.yaml and gives its path."""

    def write(description) -> str:
        path = tmp_path / "scene.yaml"
        text = description if isinstance(description, str) else yaml.safe_dump(description)
        path.write_text(text)
        return path

    return write


@pytest.fixture
def minimal(tetrahedron):
    """The shortest description of a mesh, to be changed by a test."""
    return {"objects": [{"file": tetrahedron.name}]}
