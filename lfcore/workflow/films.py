"""Films of light fields by jobs of a few instants each."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from lfcore.errors import SettingsError
from lfcore.opencl.device import Device
from lfcore.optics.size import Size
from lfcore.readers.load import load_scene
from lfcore.rendering.defaults import recorded_lens
from lfcore.rendering.record_film import Ahead, Film
from lfcore.rendering.recording import Recording
from lfcore.scene.baked import BakedLight
from lfcore.storage.codecs import Encoding
from lfcore.workflow import cases


def film_of(
    settings: Mapping[str, Any],
    files: Sequence[str],
    light: Sequence[str],
    device: Device,
    ahead: Ahead | None = None,
) -> tuple[Film, dict[str, Any]]:
    """Return the film that a configuration asks for, and the facts for its file.

    The first of ``files`` is the scene's; ``light`` has the file of its baked light, if it has one.
    ``ahead`` is that of an earlier job.  Raises :class:`SettingsError` for a scene at rest.
    """
    keys, size = settings["film"], Size.of(settings["pixels"])
    scene = load_scene(files[0], bare=True)
    for file in light:
        scene = replace(scene, light=BakedLight.load(file))
    moves = scene.instants
    if moves is None:
        remedy = "Leave the scene out, or give its objects a motion"
        raise SettingsError("does not move", file=files[0], key="film", remedy=remedy)
    scene, camera, content = recorded_lens(scene, size)
    times = [moves[0] + frame / keys["fps"] for frame in range(keys["frames"])]
    opened, closed = keys["shutter_s"]
    if opened != closed:
        scene = scene.exposed(opened, closed)
        content["shutter_s"] = [opened, closed]
    encoding = Encoding(**cases.without_null(settings["encoding"]))
    recording = Recording(Path(), scene, camera, size, None, encoding, content, device, None)
    return recording.planned_film(times, ahead=ahead)
