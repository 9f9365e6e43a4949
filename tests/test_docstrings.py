"""The examples in public docstrings run; they share a scene and a light field of it."""

import doctest
import inspect

import numpy as np
import pytest
import trimesh

import lfcore

WITHOUT_EXAMPLES = {
    "Aperture", "BakeOptions", "BakedLight", "DepthRange", "Description", "Device", "Extent",
    "Geometry", "Light", "Material", "Metadata", "Motion", "Note", "Order", "ReadOptions",
    "Rendering", "Selection", "StoredDepth", "View", "ViewerPage", "WriteOptions",
}  # fmt: skip
"""Arguments and results of the functions whose examples have them."""
MAKE_SETS = {"Stacks", "make_dataset"}
"""Their examples make scenes of data sets, which takes seconds."""


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    folder = tmp_path_factory.mktemp("examples")
    mesh = trimesh.creation.icosphere(subdivisions=1)
    mesh.export(folder / "ball.obj")
    scene = lfcore.Scene.from_triangles(mesh.triangles, name="ball")
    field = lfcore.record(scene, folder / "field.mkv", pixels=16, f_number=2)
    return folder, {"lfcore": lfcore, "np": np, "scene": scene, "field": field}


def examples():
    for name in sorted(lfcore.__all__):
        public = getattr(lfcore, name)
        if isinstance(public, type) and issubclass(public, Exception):
            continue
        for test in doctest.DocTestFinder(recurse=inspect.isclass(public)).find(public, name):
            if test.examples or (test.name == name and name not in WITHOUT_EXAMPLES):
                slow = pytest.mark.slow if test.name in MAKE_SETS else ()
                yield pytest.param(test, id=test.name, marks=slow)


@pytest.mark.parametrize("test", list(examples()))
def test_examples_of_public_docstrings_run(test, names, monkeypatch):
    folder, shared = names
    monkeypatch.chdir(folder)
    assert test.examples, "has no example"
    test.globs = dict(shared)
    said = []
    doctest.DocTestRunner(verbose=False).run(test, out=said.append)
    assert not said, "".join(said)
