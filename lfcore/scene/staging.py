"""Lights and camera that a scene's glTF files bring, for a description that gives none."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lfcore.scene.appearance import POINT, Light
from lfcore.scene.gltf import SUFFIXES, Document, FoundCamera
from lfcore.scene.notes import NOT_USED, Notebook
from lfcore.scene.surface_mesh import normalise, triple
from lfcore.scene.transforms import parse_transform


@dataclass(frozen=True)
class Staging:
    """Both in world space; ``lights`` is empty and ``camera`` None where no file has any."""

    lights: tuple[Light, ...]
    camera: FoundCamera | None


def staging_of(description: dict, file: Path, notebook: Notebook) -> Staging:
    """What the glTF files of a checked description bring; what it overrides is noted."""
    lights: list[Light] = []
    camera: FoundCamera | None = None
    for index, entry in enumerate(description["objects"]):
        name = entry.get("file", "")
        if not name.lower().endswith(SUFFIXES):
            continue
        document = Document(file.parent / name)
        key = f"objects[{index}].transform"
        matrix = parse_transform(entry.get("transform", []), file=file, key=key)
        here = [moved(light, matrix) for light in document.lights()]
        found = document.camera(notebook)
        if here and "lights" in description:
            notebook.add_in(NOT_USED, document.path, f"{len(here)} lights: the scene has its own")
        else:
            lights += here
        if found is not None and ("pose" in description["camera"] or camera is not None):
            notebook.add_in(NOT_USED, document.path, "its camera: the scene has another")
        elif found is not None:
            camera = _moved_camera(found, matrix)
    return Staging(tuple(lights), camera)


def moved(light: Light, matrix: np.ndarray) -> Light:
    """A light after an affine (4, 4) ``matrix``; what it sends stays."""
    if light.kind == POINT:
        vector = triple(matrix[:3, :3] @ light.vector + matrix[:3, 3])
        if light.is_spot:
            light = replace(light, normal=triple(normalise(matrix[:3, :3] @ light.normal)))
    else:
        vector = triple(normalise(matrix[:3, :3] @ light.vector))
    return replace(light, vector=vector)


def _moved_camera(camera: FoundCamera, matrix: np.ndarray) -> FoundCamera:
    pose = matrix @ camera.to_world
    # A scale moves the camera, and makes it no larger.
    pose[:3, :3] = normalise(pose[:3, :3].T).T
    return replace(camera, to_world=pose)
