"""``lfcore info`` and ``lfcore devices``."""

import argparse
import contextlib
import json
import os
import platform
from typing import Any

import lfcore
from lfcore.cli.command import Command, add_lightfield, open_field
from lfcore.cli.progress import note, progress
from lfcore.errors import printable
from lfcore.optics.size import Size
from lfcore.pictures import LIGHT_FIELD
from lfcore.reading import opened
from lfcore.storage.codecs import LOSSLESS

MATROSKA = b"\x1a\x45\xdf\xa3"
INFO = """\
Report a light field file's lens, resolutions, layout, codec, segments and size, or a scene's
camera and visible depth."""
INFO_EPILOG = """\
examples:
  lfcore info bike.mkv
  lfcore info model.glb             the camera, and the visible depth
  lfcore info bike.mkv --verify     read all segments and compare checksums
  lfcore info bike.mkv --json       the metadata and more, for programs
"""
DEVICES = """\
List the OpenCL devices. The default has an asterisk. LFCORE_DEVICE or --device chooses another by a
part of its name."""


def info_options(command: argparse.ArgumentParser) -> None:
    add_lightfield(command, "light field file (.mkv), its URL, or a scene")
    command.add_argument("--verify", action="store_true", help="check every segment")


def devices_options(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--check", action="store_true", help="trace a small scene on each, against exact arithmetic"
    )


def devices(arguments: argparse.Namespace) -> None:
    from lfcore.evaluation.device_check import check_apart
    from lfcore.opencl.device import all_devices, is_cpu, is_named, name_of

    name, entries = os.environ.get("LFCORE_DEVICE"), list[dict[str, Any]]()
    software = f"lfcore {lfcore.__version__}, Python {platform.python_version()}"
    software = f"{software}, {platform.platform()}"
    note(software=software, devices=entries)
    if not arguments.json:
        print(software)
    for device in all_devices():
        default = is_named(device, name) and not any(entry["default"] for entry in entries)
        entries.append({
            "name": name_of(device), "compute_units": device.max_compute_units,
            "memory_bytes": device.global_mem_size, "default": default,
        })  # fmt: skip
        remarks = [f"{device.global_mem_size / 2**30:.1f} GiB"]
        remarks += [] if is_cpu(device) else ["a GPU is slow: kernels are for processors"]
        remarks += [] if device.double_fp_config else ["no float64: some rays pass at edges"]
        if arguments.check:
            problem = entries[-1]["problem"] = check_apart(name_of(device))
            remarks.append(f"FAILS: {problem}" if problem else "passes")
        if not arguments.json:
            print(
                f"{'*' if default else ' '} {name_of(device)}, {device.max_compute_units} compute "
                f"units, {'; '.join(remarks)}",
                flush=True,
            )
    if not any(entry["default"] for entry in entries):
        lfcore.open_device()  # says which names there are
    failed = sum(bool(entry.get("problem")) for entry in entries)
    if failed and not arguments.json:
        raise lfcore.DeviceError(f"{failed} of {len(entries)} devices fail the check")


def info(arguments: argparse.Namespace) -> None:
    name = arguments.lightfield
    if not _is_light_field(name):
        info_of_scene(arguments)
        return
    field = open_field(arguments, film=True)
    if arguments.verify:
        with progress("checking", "segments") as report:
            field.verify(report)
    note(
        file=str(field.path), bytes=field.path.stat().st_size,
        damage=[damage.reason for damage in field.damage],
        metadata=json.loads(field.metadata.to_text()),
    )  # fmt: skip
    if not arguments.json:
        _print(facts(field))


def _is_light_field(name: str) -> bool:
    """Whether a file is Matroska's; one that is not there, or is a URL, by its name."""
    if "://" in name or name.lower().endswith(LIGHT_FIELD):
        return True
    with contextlib.suppress(lfcore.LfcoreError), opened(name) as file:
        return file.read(len(MATROSKA)) == MATROSKA
    return False


def info_of_scene(arguments: argparse.Namespace) -> None:
    scene = lfcore.load_scene(arguments.lightfield)
    camera, seen = scene.camera, scene.depth_range
    note(
        file=arguments.lightfield, name=scene.name, triangles=scene.triangle_count,
        camera=camera.to_json(), notes=[str(each) for each in scene.notes],
        account=[vars(count) | {"file": str(count.file)} for count in scene.account],
        **({f"{end}_m": distance for end, distance in seen.ends().items()} if seen else {}),
    )  # fmt: skip
    view = f", film {scene.view.film[0]} x {scene.view.film[1]}" if scene.view else ""
    lines = {
        "scene": scene.name, "triangles": f"{scene.triangle_count:,}",
        "materials": f"{len(scene.materials)}, textures: {len(scene.textures)}",
        "lights": str(len(scene.lights)),
        "camera": ("a pinhole" if scene.is_pinhole else _lens(camera)) + view,
        "focus": f"{camera.focus_m:g} m", "seen": str(seen or "nothing"),
    }  # fmt: skip
    if not arguments.json:
        _print(lines)
        for key, text in {"account": scene.account_text(), "notes": scene.summary()}.items():
            for number, line in enumerate(text.splitlines()):
                _print({"" if number else key: line})


def _print(lines: dict[str, str]) -> None:
    for name, value in lines.items():
        print(f"{name:<15} {printable(value)}")


def _lens(camera: lfcore.Camera) -> str:
    return (
        f"{1e3 * camera.focal_length_m:g} mm f/{camera.f_number:g}, "
        f"sensor {1e3 * camera.sensor_width_m:g} mm"
    )


def facts(field: lfcore.LightField) -> dict[str, str]:
    """The facts that ``lfcore info`` prints, by name."""
    metadata, layout, depth = field.whole, field.layout, field.whole.depth
    size = field.path.stat().st_size
    (columns, rows), (width, height) = field.grid, field.picture_size
    rays, film = columns * rows * width * height, metadata.film
    all_rays = rays * len(field.times)
    lines = {"file": str(field.path), "scene": str(metadata.scene.get("name")), **_optics(field)}
    if film is not None:
        first, last = film.times[0], film.times[-1]
        lines["instants"] = (
            f"{len(film.times)}, {first:g} to {last:g} s, coded in groups of {film.group}"
        )
    lines |= {
        "resolution": f"{width} x {height} pixels, {columns} x {rows} views, {rays:,} rays",
        "layout": f"{layout.kind}, {layout.order}, {layout.elements_per_frame} per frame, "
        f"{metadata.segments.frames} frames of {layout.frame_width} x {layout.frame_height}",
        "codec": f"{metadata.codec}, {layout.pixel_format}{_settings(metadata.settings)}",
        "segments": f"{len(metadata.segments)}, damaged: {len(field.damage)}",
        "size": f"{size:,} bytes, {8 * size / all_rays:.4f} bits per ray, "
        f"1 : {3 * all_rays / size:.1f} of 8-bit RGB",
        "software": metadata.software,
    }
    if depth is None:
        return lines
    if specular := metadata.specular:
        parts = [size for each in (specular, specular.depth) for size, _ in each.segments]
        lines["specular light"] = f"{sum(parts):,} bytes with virtual depths"
    of_depth = sum(size for size, _ in depth.segments)
    shown = Size(*field.require_slab().picture(depth.pixels)[2:])
    share = of_depth / (of_depth + sum(part.bytes for part in metadata.segments))
    return lines | {
        "depth stream": f"{depth.codec}, {depth.codes.pixel_format}{_settings(depth.settings)}, "
        f"{of_depth:,} bytes, {share:.0%} of the video, {8 * of_depth / all_rays:.4f} bits "
        "per ray",
        "by depth": f"for {Size.of(field.views_to_serve)} views, pictures of {shown} pixels; views "
        f"{'displaced' if depth.displaced else 'plain'}, {depth.codes.far:.4g} to "
        f"{depth.codes.near:.4g} dioptres",
    }


def _settings(settings: dict[str, Any]) -> str:
    """The encoder's settings; lossless encoders have no rate factor."""
    keys = ("preset",) if settings.get("codec") in LOSSLESS else ("crf", "preset")
    return "".join(f", {key} {settings[key]}" for key in keys if settings.get(key) is not None)


def _optics(field: lfcore.LightField) -> dict[str, str]:
    if field.array is not None:
        array, (nx, ny) = field.array, field.array.cameras
        columns, rows = array.columns_m, array.rows_m
        return {
            "geometry": f"camera array, {nx} x {ny} of {array.fov_deg:g} degrees, x {columns[0]:g} "
            f"to {columns[-1]:g} m, y {rows[0]:g} to {rows[-1]:g} m down",
            "white": f"radiance {field.white:g}",
        }
    slab = field.require_slab()
    camera = slab.camera
    source = field.content.get("source", {}).get("format")
    lines = {"from": f"imported, {source}"} if source else {}
    if not field.metric:
        return lines | {"geometry": "not known: refocus in pixels, --focus 1.5px"}
    lines |= {
        "lens": _lens(camera),
        "focus": f"{camera.focus_m:g} m",
        "views": f"{1e3 * slab.lens_pitch_m:.4g} mm apart",
    }
    if expected := field.content.get("expected"):
        near, far = expected["focus_m"]
        codec = "" if "codec_db" in expected else " before the codec"
        lines["expected"] = f"{expected['db']:g} dB{codec}, focused {near:g} to {far:g} m"
    if field.depth_range:
        near, far = field.depth_range
        px = [field.disparity_of(end) for end in (far, near)]
        lines["depth"] = f"{near:.4g} to {far:.4g} m, disparities {px[0]:.3g} to {px[1]:.3g} pixels"
    return lines


COMMANDS = {
    "info": Command(INFO, INFO_EPILOG, info_options, info),
    "devices": Command(DEVICES, "", devices_options, devices),
}
