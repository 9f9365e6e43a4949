"""The base of all commands: shared options, ``--json``, opening of files and scenes, and errors."""

from __future__ import annotations

import argparse
import json
import re
import shlex
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

import lfcore
from lfcore.cli import values
from lfcore.cli.progress import note, recorded, say, wrote
from lfcore.errors import LfcoreError, OpticsError
from lfcore.optics.planes import NORMALISATIONS
from lfcore.pictures import SUFFIXES, check_codes, check_suffix, write_pictures
from lfcore.sensor import RAW
from lfcore.storage.codecs import CODECS

Options = argparse._ActionsContainer
"""A parser, or a group of its options."""
KINDS: dict[str, dict[str, Any]] = {
    "salvage": {"action": "store_true", "help": "leave out damaged segments instead of refusing"},
    "instant": {"type": values.count(0), "metavar": "K", "help": "of a film, from 0 (0)"},
    "device": {"metavar": "NAME", "help": "part of an OpenCL device's name; see 'lfcore devices'"},
    "light_points": {"type": values.count(), "metavar": "P",
                     "help": "points per area light of a pbrt scene (12)"},
    "up": {"choices": ("y", "z"), "help": "axis of a mesh that points up (y)"},
    "view_from": {"dest": "view_from", "metavar": "SIDE",
                  "help": "see a mesh from front, back, left, right, top, or azimuth,elevation in "
                  "degrees (24,18)"},
    "zoom": {"type": values.positive, "metavar": "Z", "help": "narrow the field of view (1)"},
    "sky": {"type": values.sky, "metavar": "SKY[,KEY=VALUE...]",
            "help": "light from all around: an .hdr or .exr panorama, or #rrggbb; keys: bounces, "
            "rotation_deg, strength (the scene's)"},
    "floor": {
        "action": argparse.BooleanOptionalAction,
        "help": "a floor under the scene; without, that of a mesh is left out",
    },
    "time": {"type": values.number(), "metavar": "T",
             "help": "the instant of a scene that moves, seconds (its first)"},
    "shutter": {"type": values.shutter, "metavar": "A:B",
                "help": "open from A to B seconds after the instant: what moves is blurred"},
    "animation": {"metavar": "NAME", "help": "the animation of a glTF file to play (its first)"},
    "bare": {"action": "store_true", "help": "no sky and no floor for a mesh that has no lights"},
    "views": {"type": values.views, "metavar": "N"},
    "pixels": {"type": values.pixels, "metavar": "M", "help": "M x M pixels (256), or 1920x1080"},
    "subpixels": {"type": values.positive, "metavar": "Q"},
    "focus": {"type": values.distance, "metavar": "FOCUS"},
    "quality_db": {"type": values.positive, "metavar": "DB"},
    "most_rays": {"type": values.positive, "metavar": "R",
                  "help": "rays per pixel that --quality-db may use (4096)"},
    "samples": {"type": values.rays, "metavar": "S[:T]",
                "help": "rays per pixel, and instants of the shutter while objects move, e.g. 64:4 "
                "(the scene's; up to 16 instants)"},
    "bits": {"type": int, "choices": (8, 16), "default": 8, "help": "bits per sample of a PNG (8)"},
    "exposure": {"type": values.exposure, "default": {}, "metavar": "EV[:soft]",
                 "help": "brighter by so many stops, and highlights roll off instead of being cut "
                 "at white; -2, 0:soft"},
    "sensor": {"type": values.sensor, "metavar": "KEY=VALUE,...",
               "help": "noise and codes of a sensor: iso=800,bits=12,bayer=RGGB,read_noise_e=3, or "
               "photons, quantum_efficiency, full_well_e, black_level, seed; .tif and .dng hold "
               "raw codes, other formats the developed picture (no sensor, no noise)"},
    "aperture": {"type": values.aperture, "metavar": "SHAPE",
                 "help": "circle, square, diamond, or polygon[:BLADES[:DEGREES]] (circle); a half: "
                 "left, square:left"},
    "lens": {"metavar": "FILE",
             "help": "a lens with its aberrations and vignetting, scaled to the camera's focal "
             "length: pbrt's table of surfaces (.dat), or Zemax text (.zmx) (a perfect lens)"},
    "normalise": {"choices": NORMALISATIONS,
                  "help": "by the open samples of the aperture, or by all of the lens, so that the "
                  "picture dims as the lens stops down (aperture)"},
    "crf": {"type": values.number(0, 63),
            "help": "constant rate factor; lower is better and larger"},
    "white": {"type": values.positive, "metavar": "L",
              "help": "camera arrays: radiance of the brightest code (default: the brightest, at "
              "least 1)"},
    "baseline": {"type": values.length, "metavar": "L", "help": "between views: 6mm, 0.006m"},
    "view": {"nargs": 2, "type": values.count(0), "metavar": ("I", "J")},
}  # fmt: skip
"""The options by name, as argparse takes them."""
FLAGS = {
    "view_from": "--from", "path": "--output", "folder": "--output", "port": "--serve",
    "focus_m": "--focus", "disparity_px": "--focus", "aperture_views": "--f-number",
    "blades": "--aperture", "rotation_deg": "--aperture", "preset": "--codec",
    "pixel_format": "--codec", "layout": "--codec", "exposure_ev": "--exposure",
    "roll_off": "--exposure", "fov_deg": "--field-of-view", "variable": "--format",
    "pitch_m": "--baseline", "baseline_m": "--baseline", "pixel_pitch": "--field-of-view",
    "delta": "--focus", "tiles": "--format",
    "focus_range_m": "--focus-range",
}  # fmt: skip
"""The option that sets a parameter of the library, where it has another name."""


def add(group: Options, *names: str, **helps: str) -> None:
    """Add options to a parser or group by name; keywords add options with another help text."""
    for name, help in (dict.fromkeys(names) | helps).items():
        group.add_argument(flag(name), **(KINDS[name] | ({"help": help} if help else {})))


def flag(parameter: str) -> str:
    """The option of a parameter of the library."""
    return FLAGS.get(parameter, f"--{parameter.replace('_', '-')}")


def add_lightfield(command: Options, help: str = "light field file (.mkv), or its URL") -> None:
    """Add the light field file, for :func:`open_field`."""
    command.add_argument("lightfield", help=help)
    add(command, "salvage", "instant")


def add_output(command: Options, help: str, *, required: bool = True) -> None:
    command.add_argument("-o", "--output", type=Path, required=required, metavar="FILE", help=help)


def add_scene(command: Options, name: str = "scene", help: str | None = None, **more: Any) -> None:
    """Add the scene, and the device that traces it, for :func:`open_scene`."""
    usual = "scene.yaml, its folder, a mesh or a .pbrt file; or example, which comes with lfcore"
    command.add_argument(name, type=Path, help=help or usual, **more)
    add(command, "light_points", "up", "view_from", "zoom", "sky", "bare", "floor", "animation",
        "time", "device")  # fmt: skip


def add_encoder(command: argparse.ArgumentParser, *keys: str) -> Options:
    """Add the options of a light field's video, and return their group."""
    storage = command.add_argument_group("storage")
    storage.add_argument(
        "--codec", type=values.codec(*keys), default={}, metavar="NAME[,KEY=VALUE...]",
        help=f"{', '.join(CODECS)} (lossless); keys: {', '.join(('preset', 'pixel_format', *keys))}"
        f" (libx264; others by the number of views)",
    )  # fmt: skip
    add(storage, "crf")
    return storage


def encoder(arguments: argparse.Namespace) -> lfcore.Encoding:
    """The encoding that the options of :func:`add_encoder` give."""
    return lfcore.Encoding(**arguments.codec, **given(arguments, "crf"))


def given(arguments: argparse.Namespace, *names: str) -> dict[str, Any]:
    """The arguments among these names that were given or have a default."""
    values_of = {name: getattr(arguments, name, None) for name in names}
    return {name: value for name, value in values_of.items() if value is not None}


def form(arguments: argparse.Namespace) -> dict[str, Any]:
    """``--bits``, ``--exposure`` and ``--sensor`` as :func:`write_named` takes them."""
    return {"bits": arguments.bits, "sensor": arguments.sensor, **arguments.exposure}


def check_output(arguments: argparse.Namespace, suffixes: Sequence[str] = SUFFIXES) -> None:
    """Raise :class:`LfcoreError` for a name of no format, or of one without these codes."""
    path = arguments.output
    check_suffix(path, (*suffixes, *RAW) if arguments.sensor else suffixes)
    if not arguments.sensor or path.suffix.lower() not in RAW:
        check_codes(path, arguments.bits, bool(arguments.exposure))
    elif arguments.exposure or arguments.bits != 8:
        option = "--exposure" if arguments.exposure else "--bits"
        refuse(option, "is not for raw codes", "Leave it out, or write a .png")
    if path.suffix.lower() == ".dng" and not arguments.sensor.bayer:
        refuse("--sensor", "has no Bayer pattern, which DNG needs", "Add bayer=RGGB")


def flags(arguments: argparse.Namespace, *names: str) -> list[str]:
    """The flags among these names that were given."""
    return [
        flag(name)
        for name, value in given(arguments, *names).items()
        if value is not False and value not in ([], {})
    ]


@dataclass(frozen=True)
class Command:
    """One command: its texts for ``--help``, and functions that add its options and run it.

    A command without ``run`` has commands of its own.
    """

    description: str
    examples: str
    options: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace], None] | None = None

    def add_to(self, commands: argparse._SubParsersAction[Any], name: str, help: str) -> None:
        """Add it to the commands of a parser."""
        parser = commands.add_parser(
            name, help=help, description=self.description, epilog=self.examples
        )
        self.options(parser)
        if self.run is not None:
            of_flag = {flag: each.dest for each in parser._actions for flag in each.option_strings}
            parser.set_defaults(run=partial(_run, self.run, of_flag), command=name)
            parser.add_argument(
                "--json", action="store_true", help="print one JSON object for programs, no words"
            )


def _run(
    run: Callable[[argparse.Namespace], None],
    of_flag: Mapping[str, str],
    arguments: argparse.Namespace,
) -> None:
    """Run a command; with ``--json``, print the record as one line when all is done.

    ``of_flag`` has the argument's name of each flag.
    """
    try:
        # First: a missing device is an error even if it would not be used.
        if getattr(arguments, "device", None) is not None:
            arguments.device = lfcore.open_device(arguments.device)
        if not arguments.json:
            run(arguments)
            return
        with recorded(arguments.command) as record:
            run(arguments)
    except LfcoreError as error:
        raise _with_flags(error, of_flag, arguments) from None
    # JSON has no infinity: the text "inf" replaces it.
    finite = json.loads(json.dumps(record), parse_constant=lambda name: str(float(name)))
    print(json.dumps(finite))


def _with_flags(
    error: LfcoreError, of_flag: Mapping[str, str], arguments: argparse.Namespace
) -> LfcoreError:
    """The library's error with the command's flags in place of parameters.

    Its key is a parameter if the user gave that option, or if it is about no file.
    """

    def in_words(text: str | None) -> str | None:
        return text and re.sub(
            r"(?<![\w.'\"])[a-z]+(_[a-z]+)+(?![\w.'\"=:])",
            lambda name: flag(name[0]) if flag(name[0]) in of_flag else name[0],
            text,
        )

    key, option = error.key, flag(error.key or "")
    if key and key.startswith("--"):  # the command's own error
        return error
    if option in of_flag and (error.file is None or flags(arguments, of_flag[option])):
        key = option
    problem, remedy = in_words(error.problem), in_words(error.remedy)
    return type(error)(problem or "", file=error.file, key=key, remedy=remedy)


def _as_options(notes: str) -> str:
    """The text with options in place of the library's keywords: ``up="z"`` is ``--up z``."""
    keyword = re.compile(r'\b(up|view_from|bare|animation)=(?:True|"([^"]*)")')
    notes = notes.replace(".at()", flag("time"))
    return keyword.sub(
        lambda it: f"{flag(it[1])} {(it[2] and shlex.quote(it[2])) or ''}".rstrip(), notes
    )


def open_field(arguments: argparse.Namespace, *, film: bool = False) -> lfcore.LightField:
    """Open the light field, and report damaged segments that are left out.

    A film is opened at one instant, which is reported unless the command uses all (``film``).
    """
    field = lfcore.LightField.open(arguments.lightfield, salvage=arguments.salvage)
    if arguments.instant is not None:
        field = field.at(arguments.instant)
    elif len(field.times) > 1 and not film:
        say(f"the first of {len(field.times)} instants; --instant has others")
    for damage in field.damage:
        say(f"left out: {damage.reason}")
    return field


def open_scene(arguments: argparse.Namespace) -> lfcore.Scene:
    """Load the scene, and report its size and what was approximated or left out."""
    how = given(
        arguments, "light_points", "up", "view_from", "zoom", "bare", "floor", "animation", "pixels"
    )
    scene = lfcore.load_scene(arguments.scene, light=arguments.sky, **how)
    for line in _as_options(scene.summary()).splitlines():
        say(line)
    start = scene.instants[0] if scene.instants else 0.0
    if arguments.time is not None:
        if scene.instants is None:
            refuse("--time", "the scene does not move", "Leave it out")
        start = arguments.time
    if getattr(arguments, "shutter", None) is not None:
        opened, closed = arguments.shutter
        if scene.instants is None:
            refuse("--shutter", "the scene does not move", "Leave it out")
        scene = scene.exposed(start + opened, start + closed)
    elif arguments.time is not None:
        scene = scene.at(start)
    seen = scene.depth_range
    say(f"{scene.name}: {scene.triangle_count} triangles" + (f", {seen}" if seen else ""))
    note(scene={"name": scene.name, "triangles": scene.triangle_count, "left_out": scene.dropped})
    if seen:
        note(**{f"{end}_m": distance for end, distance in seen.ends().items()})
    for reason, count in scene.dropped.items():
        say(f"{count} triangles were left out: {reason}")
    return scene


def refuse(key: str, problem: str, remedy: str | None = None) -> NoReturn:
    """Raise :class:`OpticsError` about an option."""
    raise OpticsError(problem, key=key, remedy=remedy)


def write_named(
    named: Sequence[tuple[Path, np.ndarray]], sensor: lfcore.Sensor | None = None, **form: Any
) -> None:
    """Write all pictures or none, and report their names; ``form`` is :func:`form`'s."""
    if sensor:
        raws = [(path, sensor.raw(picture, k)) for k, (path, picture) in enumerate(named)]
        named = [(path, sensor.developed(raw)) for path, raw in raws]
    if sensor and named[0][0].suffix.lower() in RAW:
        for path, raw in raws:
            sensor.write_raw(path, raw)
    else:
        write_pictures(named, **form)
    for path, _ in named:
        wrote(path)
