"""The scenes, tiles, layouts, encoders and sensor planes of a checked configuration."""

import math
import os
import re
import tempfile
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lfcore.errors import OpticsError, SettingsError, StorageError
from lfcore.optics.camera import Camera
from lfcore.optics.focus import DepthRange, exclude_twice, f_number_of_blur, focus_distance
from lfcore.optics.planes import SensorPlane
from lfcore.optics.slab import Slab
from lfcore.scene.files import read_header
from lfcore.storage import defaults
from lfcore.storage.codecs import Encoding
from lfcore.storage.layout import FrameLayout, Tile

SCENES = "LFCORE_SCENES"
"""The environment variable with the folder of the project's scenes, which wheels lack."""
MIB = 2**20
BYTES_PER_RAY = 3
"""The bytes of a ray in raw 8-bit RGB."""
LONGEST_NAME = 100
"""The most characters of a scene's name, which is part of file names."""
RESERVED = {"tables", "assignment", "sweeps", "datasets"}
"""The folders of results that belong to no scene."""
OWN = {"chart", "book", "sphere", "ecosys"}
"""The scenes of figures and of the assignment, whatever scenes are in the tables."""


def scenes_folder() -> Path:
    """Return the folder with the project's scenes: the workflow's, or this checkout's."""
    return Path(os.environ.get(SCENES) or Path(__file__).resolve().parents[2] / "scenes")


def own_scenes() -> dict[str, str]:
    """Return the name and file of each of the project's scenes."""
    return {file.parent.name: str(file) for file in scenes_folder().glob("*/scene.yaml")}


def scene_files(entries: Iterable[str]) -> dict[str, str]:
    """Return the name and file of each scene: a folder below ``scenes/``, or a path to a file.

    Paths are relative to the working folder, names to the project.  A name has letters, digits,
    ``_``, ``-``, ``+`` and ``.``; others become ``_``.  Raises :class:`SettingsError` for a scene
    that does not exist and for two with the same name.
    """
    files: dict[str, str] = {}
    for entry in entries:
        file = scenes_folder() / entry / "scene.yaml"
        if not os.path.exists(file):  # also for names that are too long
            file = Path(entry) / "scene.yaml" if os.path.isdir(entry) else Path(entry)
        if not os.path.isfile(file):
            remedy = "Give the name of a folder below scenes/, or the path of a scene or mesh"
            if not scenes_folder().is_dir():
                remedy = "The project's scenes are in its repository, not in the package: run the "
                remedy += f"workflow in a checkout, set {SCENES} to its folder scenes, or give the "
                remedy += "path of a scene or mesh"
            problem = f"there is no scene {entry!r}"
            raise SettingsError(problem, key="configuration: scenes", remedy=remedy)
        files[_scene_name(file, files)] = str(file)
    return files


def _scene_name(file: Path, names: Iterable[str]) -> str:
    """Return the name of a scene's folder of results: its folder's or its file's name."""
    name = file.resolve().parent.name if file.name == "scene.yaml" else file.stem
    name = re.sub(r"[^\w.+-]|^\.", "_", unicodedata.normalize("NFC", name))
    project_file = own_scenes().get(name)
    if len(name) > LONGEST_NAME:
        problem = f"{name!r} is too long for a folder of results"
    elif name.lower() in RESERVED:
        problem = f"results/{name}/ is reserved"
    elif name in names:
        problem = f"two scenes are called {name!r}"
    elif name in OWN and project_file and file.resolve() != Path(project_file).resolve():
        problem = f"{name!r} is a scene of this project, which other results need"
    else:
        return name
    raise SettingsError(
        problem, file=file, key="configuration: scenes", remedy="Rename the folder or the file"
    )


def frame_layout(settings: Mapping, views: int) -> FrameLayout:
    """Return the layout of rays in frames for ``views`` per side.

    Raises :class:`StorageError` for frames too small for the encoder.
    """
    spec = encoding(settings, views)
    layout = defaults.frame_layout(
        views, settings["pixels"], spec.stored_format, **without_null(settings["layout"])
    )
    spec.check_frame(layout.frame_width, layout.frame_height)
    return layout


def tiles(settings: Mapping, views: int) -> list[Tile]:
    """Return the tiles of N = ``views``, each at most ``tile_mib`` of raw 8-bit RGB."""
    return frame_layout(settings, views).tiles(settings["tile_mib"] * MIB // BYTES_PER_RAY)


def encoding(settings: Mapping, views: int) -> Encoding:
    """Return the encoder's settings for ``views`` per side, with one thread: reproducible."""
    return defaults.chosen_encoding(views, Encoding(**without_null(settings["encoding"])))


def check_encoder(spec: Encoding, layout: FrameLayout) -> None:
    """Encode a black frame; raises :class:`SettingsError` for settings unknown to the codec."""
    from lfcore.storage.segment import SegmentWriter  # loads the codecs

    size = layout.frame_width, layout.frame_height
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            SegmentWriter(Path(folder) / "black.mp4", spec, *size) as writer,
        ):
            writer.write(np.zeros((1, layout.frame_bytes), np.uint8))
    except StorageError as error:
        key, remedy = "configuration: encoding", "Check the names of preset and tune"
        raise SettingsError(error.problem, key=key, remedy=remedy) from None


def without_null(settings: Mapping) -> dict:
    """Return settings as the library's keywords: null leaves the choice to the library."""
    return {
        key: str(value) if key == "preset" else value
        for key, value in settings.items()
        if value is not None or key == "tune"
    }


def sensor_planes(
    planes: str | Sequence[Mapping], camera: Camera, focus_distances_m: Sequence[float]
) -> list[SensorPlane]:
    """Return a scene's planes by ``planes``, the configuration's key.

    Words for a focus refer to the first and the last of ``focus_distances_m``.
    Raises :class:`SettingsError` that names the key for a plane the lens cannot form.
    """
    if isinstance(planes, str):  # "scene"
        return [SensorPlane(distance, camera.f_number) for distance in focus_distances_m]
    checked = []
    for index, keys in enumerate(planes):
        settings = {key: value for key, value in keys.items() if value is not None}
        try:
            plane = _plane(settings, camera, focus_distances_m)
            plane.check(Slab(camera, 2, 2))
        except OpticsError as error:
            key = f"configuration: planes.{index}.{error.key}"
            raise error.named(SettingsError, key=key) from None
        checked.append(plane)
    return checked


def _plane(
    settings: dict[str, Any], camera: Camera, focus_distances_m: Sequence[float]
) -> SensorPlane:
    exclude_twice(f_number=settings.get("f_number"), blur=settings.get("blur"))
    depths = DepthRange(focus_distances_m[0], focus_distances_m[-1]) if focus_distances_m else None
    focus_m = focus_distance(settings.pop("focus_m"), depths)
    f_number = settings.pop("f_number", camera.f_number)
    if "blur" in settings:
        f_number = f_number_of_blur(
            settings.pop("blur"), camera.focal_length_m, focus_m, camera.field_width, depths
        )
    return SensorPlane(focus_m, f_number, **settings)


def read_camera(scene: str | Path) -> tuple[Camera, tuple[float, ...], int]:
    """Read camera, focus distances and number of triangles of a scene.npz, without its arrays."""
    head = read_header(scene)
    return Camera.from_json(head["camera"]), tuple(head["focus_distances_m"]), head["triangles"]


def aperture_stack(stops: Sequence[float], camera: Camera, focus_m: float) -> list[SensorPlane]:
    """Return planes with one focus and a closing lens: first dimmed (thesis figure 4.3), then
    normalised (4.4)."""
    return [
        SensorPlane(focus_m, camera.f_number * math.sqrt(2) ** stop, normalise=normalise)
        for normalise in ("lens", "aperture")
        for stop in stops
    ]
