"""What a checked configuration asks for: scenes, tiles, layouts, encoders, sensor planes."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from lfcore.errors import OpticsError, SettingsError
from lfcore.optics.camera import Camera
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.files import read_header
from lfcore.storage import defaults
from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import FrameLayout, Tile

MIB = 2**20
BYTES_OF_A_RAY = 3
NAME = re.compile(r"[\w+-][\w.+-]{0,99}")
"""What a scene may be called: its results have this folder, and rules a pattern of all names."""
RESERVED = {"tables", "assignment", "sweeps"}
OWN = {"chart", "book", "sphere", "ecosys"}
"""Scenes that figures and the assignment show, whatever scenes are in the tables."""


def scene_files(entries: Iterable[str], root: Path) -> dict[str, str]:
    """Name and file of each scene: a folder below ``scenes/``, or a path to a file.

    Paths are relative to the working folder; names to ``root``.  Raises :class:`SettingsError`
    for what does not exist and for two scenes of one name.
    """
    found: dict[str, str] = {}
    for entry in entries:
        file = root / "scenes" / entry / "scene.yaml"
        if not os.path.exists(file):  # False, too, for a name too long
            file = Path(entry) / "scene.yaml" if os.path.isdir(entry) else Path(entry)
        if not os.path.isfile(file):
            raise SettingsError(
                f"there is no scene {entry!r}",
                key="configuration: scenes",
                remedy="Give the name of a folder below scenes/, or the path of a scene or mesh",
            )
        found[_scene_name(file, root, found)] = str(file)
    return found


def _scene_name(file: Path, root: Path, taken: Iterable[str]) -> str:
    """Name of a scene's folder of results: of its folder, or of its file."""
    name = file.resolve().parent.name if file.name == "scene.yaml" else file.stem
    rename = "Rename the folder or the file"
    if not NAME.fullmatch(name):
        problem = f"{name!r} cannot be a folder of results"
        rename += "; a name has letters, digits, '_', '-', '+' and '.', and begins with no '.'"
    elif name.lower() in RESERVED:
        problem = f"results/{name}/ is not a scene's"
    elif name in taken:
        problem = f"two scenes are called {name!r}"
    elif name in OWN and file.resolve() != (root / "scenes" / name / "scene.yaml").resolve():
        problem = f"{name!r} is a scene of this project, which other results are made of, too"
    else:
        return name
    raise SettingsError(problem, file=file, key="configuration: scenes", remedy=rename)


def is_procedural(file: str | Path) -> bool:
    """Whether a scene may name a builder of procedural models: then it depends on their sources."""
    try:
        return "builder" in Path(file).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False  # parsing says what is wrong with it


def frame_layout(settings: Mapping, views: int) -> FrameLayout:
    """How the rays of N = ``views`` are laid out in frames; null is what measured best.

    Raises :class:`StorageError` for frames too small for the encoder.
    """
    spec = encoding(settings, views)
    layout = defaults.frame_layout(
        views, settings["spatial_resolution"], spec.stored_format, **nulls(settings["layout"])
    )
    spec.check_frame(layout.frame_width, layout.frame_height)
    return layout


def nulls(keys: Mapping) -> dict:
    """Keys whose "auto" is None, as the library has it."""
    return {key: None if value == "auto" else value for key, value in keys.items()}


def tiles(settings: Mapping, views: int) -> list[Tile]:
    """The tiles of N = ``views``, each at most ``tile_mib`` of raw 8-bit RGB."""
    return frame_layout(settings, views).tiles(settings["tile_mib"] * MIB // BYTES_OF_A_RAY)


def encoding(settings: Mapping, views: int) -> Encoding:
    """Settings of the encoder at N = ``views``; one thread, so that a stream is reproducible.

    null is what measured best for H.264 at that N, or goes by that for other codecs.
    """
    return defaults.chosen_encoding(views, Encoding(**nulls(settings["encoder"])))


def sensor_planes(
    planes: str | Sequence[Mapping], camera: Camera, focus_distances_m: Sequence[float]
) -> list[SensorPlane]:
    """The planes of ``planes`` (the configuration's key) for one scene.

    Raises :class:`SettingsError` that names the key for a plane the lens cannot form.
    """
    if isinstance(planes, str):  # "scene"
        return [SensorPlane(distance, camera.f_number) for distance in focus_distances_m]
    made = []
    for index, given in enumerate(planes):
        settings: dict[str, Any] = {"f_number": camera.f_number, **given}
        plane = SensorPlane(**settings)
        try:
            plane.check(Slab(camera, 2, 2))
        except OpticsError as error:
            key = f"configuration: planes.{index}.{error.key}"
            raise error.named(SettingsError, key=key) from None
        made.append(plane)
    return made


def read_camera(scene: str | Path) -> tuple[Camera, tuple[float, ...], int]:
    """Camera, focus distances and number of triangles of a scene.npz, without its arrays."""
    header = read_header(scene)
    camera = Camera.from_json(header["camera"])
    return camera, tuple(header["focus_distances_m"]), header["triangles"]


def aperture_stack(stops: Sequence[float], camera: Camera, focus_m: float) -> list[SensorPlane]:
    """One focus, closing lens: first all dimmed (thesis figure 4.3), then all normalised (4.4)."""
    return [
        SensorPlane(focus_m, camera.f_number * math.sqrt(2) ** stop, normalise=normalise)
        for normalise in ("lens", "aperture")
        for stop in stops
    ]
