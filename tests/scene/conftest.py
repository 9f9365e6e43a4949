"""Small scenes and meshes on disk that the scene tests share."""

import pytest
import yaml

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
