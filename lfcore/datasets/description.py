"""The description of a data set: one file, checked before any item is made.

A number that varies between scenes is a range, ``[low, high]`` or ``[low, high, log]``, or a single
number.
"""

from __future__ import annotations

import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import pydantic
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field

from lfcore.checked_keys import refusal
from lfcore.errors import OpticsError, SettingsError
from lfcore.files import file_digest
from lfcore.optics.size import Size
from lfcore.reading import read_yaml
from lfcore.sensor import Sensor

KINDS = (
    "focal_stacks", "infinigen_defocus", "light_fields", "defocus_pairs", "dual_pixel", "films",
)  # fmt: skip
SPLITS = ("train", "validation", "test")
TEXTURES = (".png", ".jpg", ".jpeg", ".webp")
"""The suffixes of textures in a folder."""
MESHES = (".glb", ".gltf", ".obj", ".ply", ".stl", ".off")
"""The suffixes of meshes in a folder."""
SHAPES = (
    "ball", "block", "blob", "rod", "cone", "ring", "vase", "tower", "train", "book", "armchair",
    "plant", "table", "lamp", "globe", "bottle", "tumbler", "goblet", "bowl", "pan",
)  # fmt: skip
"""The procedural shapes, built by :mod:`lfcore.datasets.shapes`."""
LIGHTS = ("sun", "point", "spot")
"""The kinds of lights."""


class _Keys(BaseModel):
    model_config = ConfigDict(
        extra="forbid", allow_inf_nan=False, frozen=True, validate_default=True
    )


def _as_range(value: Any) -> Any:
    """Return a single number or a pair as a range."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return [value, value, "even"]
    is_pair = isinstance(value, list | tuple) and len(value) == 2
    return [*value, "even"] if is_pair else value


def _ascending(value: tuple[float, float, str]) -> tuple[float, float, str]:
    low, high, kind = value
    if low > high:
        raise ValueError(f"the range must ascend: {low:g} is above {high:g}")
    if kind == "log" and low <= 0:
        raise ValueError("a range that is even in logarithms must be above 0")
    return value


def span(least: float, most: float) -> Any:
    """Return the type of a range between two limits."""
    number = Annotated[float, Field(ge=least, le=most)]
    kind = tuple[number, number, Literal["even", "log"]]
    return Annotated[kind, BeforeValidator(_as_range), AfterValidator(_ascending)]


Share = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0, le=1e6)]
_key: Any = Field


class Counts(_Keys):
    train: int = _key(400, ge=0, le=10**7, description="number of scenes; the first ones")
    validation: int = _key(100, ge=0, le=10**7, description="number of those that follow")
    test: int = _key(0, ge=0, le=10**7, description="number of the last ones")


class Shapes(_Keys):
    meshes: str | list[str] = _key([], description="a folder of mesh files, or a list of files")
    licence: str = _key(
        "", description="licence and source of meshes that have no file MESH.license beside them"
    )
    builders: list[Literal[SHAPES]] = _key(list(SHAPES), description="procedural shapes")
    share_of_meshes: Share = _key(0.5, description="share of meshes among objects")


class Materials(_Keys):
    textures: str = _key("", description="a folder of pictures; empty: procedural ones")
    share_textured: Share = _key(0.85, description="share of textures on untextured objects")
    repeats: span(0.1, 100) = _key((1, 4, "log"), description="repeats of a texture over an object")
    share_redressed: Share = _key(
        0.25, description="share of furniture and toys in one new material; others vary in colour"
    )
    share_metal: Share = _key(0.15, description="share of metal objects; six times for pans")
    share_polished: Share = _key(0.5, description="share of metal that mirrors")
    share_glass: Share = _key(
        0.1, description="share of glass objects; six times for vases, bowls and bottles"
    )
    share_coated: Share = _key(0.15, description="share of other objects with a coat")
    share_panes: Share = _key(0.8, description="share of windows with glass")
    share_mirrors: Share = _key(0.15, description="share of mirrors on walls")
    roughness: span(0.02, 1) = _key((0.15, 1, "even"), description="roughness of objects")


class Lights(_Keys):
    kinds: list[Literal[LIGHTS]] = _key(list(LIGHTS), min_length=1, description="kinds of lights")
    count: span(1, 8) = _key((1, 3, "even"), description="lights per scene")
    strength: span(0, 100) = _key((0.6, 1.4, "even"), description="irradiance of all together")
    elevation_deg: span(5, 90) = _key((20, 80, "even"), description="elevation of lights, degrees")
    ambient: span(0, 10) = _key((0.1, 0.3, "even"), description="light without direction")
    share_sky: Share = _key(
        0.5, description="share of scenes lit by a baked sky; others have even ambient light"
    )


class Lens(_Keys):
    focal_length_mm: span(1e-3, 1e6) = _key(2.9, description="of the lens")
    sensor_width_mm: Positive = _key(
        3.1, description="the width of the picture on the sensor; of a wide one the height"
    )
    f_number: span(0.1, 1e6) = _key(1.0, description="of stacks and pairs")
    stops: list[Positive] = _key(
        [1.4, 2.0, 2.8, 4.0, 5.6], min_length=1, max_length=20,
        description="f-numbers of `infinigen_defocus` in place of `f_number`, each at every focus "
        "distance",
    )  # fmt: skip
    focus_m: list[Positive] = _key(
        [0.1, 0.15, 0.3, 0.7, 1.5], min_length=1, max_length=100,
        description="of a stack's pictures; of a pair one of them; of a light field the first",
    )  # fmt: skip
    random_focus: int = _key(
        0, ge=0, le=100, description="instead, this many distances per item between the least and "
        "the greatest focus_m, at random in dioptres; 0: focus_m",
    )  # fmt: skip
    views: int = _key(9, ge=2, le=64, description="per side of a light field")
    baseline_mm: Positive = _key(4.0, description="between neighbouring views")


class Frames(_Keys):
    count: int = _key(1, ge=1, le=1000, description="instants per item, with flow between them")
    fps: float = _key(24, gt=0, le=1e6, description="instants per second")
    share_moving: Share = _key(0.5, description="of objects; animated meshes play in any case")
    speed: span(0, 1e3) = _key(
        (0.2, 2, "log"),
        description="in an object's diameters per second; in rooms things turn only",
    )
    turn_deg: span(0, 1e5) = _key((0, 90, "even"), description="degrees per second")
    shutter: Share = _key(
        0.0, description="of the time between instants, for which the shutter is open; pictures "
        "blur, while the sharp one, depth, flow and truth show the middle of that time",
    )  # fmt: skip

    @property
    def moving(self) -> bool:
        """Whether pictures show that things move."""
        return self.count > 1 or self.shutter > 0

    @property
    def times(self) -> tuple[float, ...]:
        """The instants, seconds."""
        return tuple(number / self.fps for number in range(self.count))


class Placement(_Keys):
    objects: span(1, 1000) = _key((12, 30, "even"), description="per scene")
    depth_m: span(1e-3, 1e6) = _key((0.12, 2.0, "log"), description="of objects")
    size: span(1e-3, 10) = _key(
        (0.15, 0.6, "log"), description="an object's diameter as a share of the field there"
    )
    share_rooms: Share = _key(0.0, description="share of scenes in a furnished room of real size")
    share_resting: Share = _key(0.5, description="of others with a floor; else objects fly")
    pitch_deg: span(5, 60) = _key((12, 35, "even"), description="of the camera above a floor")
    wall_m: span(1e-3, 1e6) = _key((2.2, 2.6, "even"), description="from the camera")
    least_seen: Share = _key(0.1, description="of the picture that objects must fill")


def _as_pixels(value: int | str) -> int | str:
    try:
        size = Size.of(value)
    except OpticsError as error:
        raise ValueError(error.problem) from None
    if size.shorter < 16 or size.longer > 4096:
        raise ValueError(f"each side must be from 16 to 4096 pixels, not {size}")
    if (size.longer - size.shorter) % 2:
        raise ValueError(f"width and height must differ by an even number, not {size}")
    return size.as_given


def _as_sensor(value: dict[str, Any]) -> dict[str, Any]:
    try:
        Sensor.of(value)
    except OpticsError as error:
        raise ValueError(str(error).removesuffix(".")) from None
    return value


class Description(_Keys):
    """The description of a data set; :meth:`read` reads one from a file."""

    name: str = _key(
        pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$",
        description="of the folder in results/datasets: letters, digits, _ and -",
    )
    kind: Literal[KINDS] = _key(
        description="`focal_stacks` (as in FoD500), `infinigen_defocus` (stacks at several "
        "f-numbers), `light_fields`, `defocus_pairs`, `dual_pixel` (as in DPDD) or `films` of "
        "light fields"
    )
    licence: str = _key("", description="of the data set, a URL or SPDX name")
    seed: int = _key(1, ge=0, lt=2**63, description="scenes depend on it and their number alone")
    scenes: Counts = Counts()
    split_by: Literal["scene", "mesh"] = _key(
        "scene", description="mesh: no mesh or texture of yours is in two splits; 80, 10 and 10 % "
        "of their names, by a digest of each, are in train, validation and test"
    )  # fmt: skip
    pixels: Annotated[int | str, AfterValidator(_as_pixels)] = _key(
        256, description="per side, or width and height such as 640x480"
    )
    quality_db: float = _key(45, gt=0, le=100, description="PSNR that no picture is below")
    also: list[Literal["mat", "hdf5"]] = _key(
        ["mat"], description="layouts of light fields beside HCI's"
    )
    codes: Literal["srgb8", "srgb16", "linear16", "raw16"] = _key(
        "srgb8", description="of pictures: sRGB, linear light, or the sensor's raw ones"
    )
    sensor: Annotated[dict[str, Any], AfterValidator(_as_sensor)] = _key(
        {}, description="keys of lfcore.Sensor, such as iso: 800; empty: no noise"
    )
    truth: bool = _key(
        False, description="add truth.exr: normals, albedo, numbers of objects and materials, "
        "blur, which pixels are specular, and the depth of images in them; of each view of a "
        "light field, with flow to the middle one and occlusion"
    )  # fmt: skip
    shards: bool = _key(False, description="keep WebDataset's tar files, not folders of files")
    scenes_per_job: int = _key(32, ge=1, le=10**5, description="scenes per job of the workflow")
    shapes: Shapes = Shapes()
    materials: Materials = Materials()
    lights: Lights = Lights()
    lens: Lens = Lens()
    placement: Placement = Placement()
    frames: Frames = Frames()

    @pydantic.model_validator(mode="after")
    def _consistent(self) -> Description:
        if not self.count:
            raise ValueError("scenes: there are none")
        if min(self.lens.focus_m) <= self.lens.focal_length_mm[1] / 1e3:
            raise ValueError("lens.focus_m: nearer than the lens can focus")
        if self.placement.depth_m[0] >= self.placement.wall_m[0]:
            raise ValueError("placement.depth_m: objects are beyond placement.wall_m")
        if not (self.shapes.builders or self.shapes.meshes):
            raise ValueError("shapes: neither meshes nor builders")
        if self.frames.shutter and self.kind == "light_fields":
            raise ValueError("frames.shutter: views are sharp; leave it out, or make films")
        if self.kind == "films" and (self.codes != "srgb8" or self.sensor):
            raise ValueError("kind: films have no sensor's noise, and codes of their own")
        if self.frames.moving and not (self.frames.share_moving or self.shapes.meshes):
            raise ValueError("frames.share_moving: nothing moves")
        names = {f"{metres:.1f}" for metres in self.lens.focus_m}
        if self.kind == "infinigen_defocus" and len(names) < len(self.lens.focus_m):
            raise ValueError("lens.focus_m: names have one decimal, which two distances share")
        if self.kind == "infinigen_defocus" and self.lens.random_focus:
            raise ValueError("lens.random_focus: readers of this kind expect equal distances")
        if self.codes == "raw16" and (not self.sensor or self.kind == "light_fields"):
            raise ValueError("codes: raw ones need a sensor, and focal stacks or pairs")
        return self

    @classmethod
    def check(cls, keys: Mapping[str, Any], **where: Any) -> Description:
        """Return the description of a mapping; raises :class:`SettingsError` that names the key.

        ``where`` has the error's ``file`` and the ``key`` that holds the mapping.
        """
        try:
            return cls.model_validate(keys)
        except pydantic.ValidationError as error:
            raise refusal(cls, error, **where) from None

    @classmethod
    def read(cls, path: str | Path) -> Description:
        """Read the description under the key ``dataset`` of a YAML file."""
        content = read_yaml(path)
        if not isinstance(content, dict) or not isinstance(content.get("dataset"), dict):
            raise SettingsError("has no mapping 'dataset'", file=path, remedy="Begin with dataset:")
        return cls.check(content["dataset"], file=path)

    @property
    def size(self) -> Size:
        """Width and height of the pictures."""
        return Size.of(self.pixels)

    @property
    def count(self) -> int:
        return sum(self.scenes.model_dump().values())

    def split(self, index: int) -> str:
        """Return ``train``, ``validation`` or ``test``; the splits are consecutive."""
        for name in SPLITS:
            index -= getattr(self.scenes, name)
            if index < 0:
                return name
        raise IndexError("no such scene")

    def mesh_files(self) -> list[Path]:
        """Return the user's meshes by name; raises :class:`SettingsError` for an empty folder."""
        return _files(self.shapes.meshes, MESHES, "shapes.meshes")

    def of_split(self, files: list[Path], split: str) -> list[Path]:
        """Return the meshes or textures of a split, or all if ``split`` is empty.

        Raises :class:`SettingsError` if there are files, and none of the split.
        """
        if not (split and files):
            return files
        counts = self.scenes.model_dump()

        def split_of(file: Path) -> str:
            place = int(hashlib.sha256(file.name.encode()).hexdigest()[:8], 16) / 16**8
            named = SPLITS[(place >= 0.8) + (place >= 0.9)]
            return named if counts[named] else "train" if counts["train"] else split

        chosen = [file for file in files if split_of(file) == split]
        if not chosen:
            problem = f"none of {len(files)} files is in the split {split}"
            remedy = "Give more files, or split by scene"
            raise SettingsError(problem, key="split_by", remedy=remedy)
        return chosen

    def licence_of(self, mesh: Path) -> str:
        """Return the text of MESH.license beside a mesh, else the key ``shapes.licence``."""
        file = mesh.with_name(f"{mesh.name}.license")
        if not file.exists():
            return self.shapes.licence
        return " ".join(file.read_text(encoding="utf-8", errors="replace").split())

    def texture_files(self) -> list[Path]:
        """Return the user's textures by name; raises the errors of :meth:`mesh_files`."""
        return _files(self.materials.textures, TEXTURES, "materials.textures")

    def of_scenes(self) -> dict[str, Any]:
        """Return the keys that scenes depend on: not the splits and licences."""
        keys = self.model_dump(exclude={"licence", "scenes", "shards", "scenes_per_job"})
        if self.split_by == "mesh":
            keys["scenes"] = self.scenes.model_dump()
        del keys["shapes"]["licence"]
        return keys

    def properties(self) -> dict[str, Any]:
        """Return the common properties of all pictures, for people."""
        space = "sRGB, IEC 61966-2-1"
        if not self.codes.startswith("srgb"):
            space = "linear light, sRGB primaries, white at the greatest code"
        noise = "none"
        if self.sensor:
            sensor = ", ".join(f"{key} {value}" for key, value in self.sensor.items())
            noise = f"EMVA 1288 ({sensor}), except in pictures with everything in focus"
        return {
            "colour_space": space, "bits_per_channel": 8 if self.codes == "srgb8" else 16,
            "noise": noise,
            "depth": "that of the first surface, also of panes, glass and mirrors",
            "field_of_view": "that of camera.focus_m in all pictures: no focus breathing",
        }  # fmt: skip

    def sources(self) -> str:
        """Return the digest of each mesh and texture, as JSON."""
        files = {"meshes": self.mesh_files(), "textures": self.texture_files()}
        digests = {kind: {file.name: file_digest(file) for file in files[kind]} for kind in files}
        return json.dumps(digests, indent=2)

    def digest(self, sources: str) -> str:
        """Return the digest of these keys and of ``sources``, the digests of all files."""
        keys = self.of_scenes()
        del keys["shapes"]["meshes"], keys["materials"]["textures"]
        text = json.dumps([keys, sources], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]

    def check_files(self, room: Path | None = None) -> None:
        """Raise :class:`SettingsError` if folders are missing or empty, or if the disk of the
        folder ``room`` is too small."""
        self.mesh_files()
        self.texture_files()
        if room:
            self.check_room(room)

    def check_room(self, folder: Path) -> None:
        """Raise :class:`SettingsError` if the disk lacks room for both shards and items."""
        bytes_per_pixel = 3 * ((self.lens.random_focus or len(self.lens.focus_m)) + 3)
        if self.kind == "light_fields":  # colours and disparities of each view
            also = sum({"mat": 12, "hdf5": 11}[name] for name in self.also)
            bytes_per_pixel = (7 + also) * self.lens.views**2
        elif self.kind == "infinigen_defocus":
            bytes_per_pixel = 3 * (len(self.lens.focus_m) * len(self.lens.stops) + 3)
        elif self.kind != "focal_stacks":
            bytes_per_pixel = 3 * 7  # also of a film's instant
        if self.frames.count > 1:  # instants, each with flow
            bytes_per_pixel = self.frames.count * (bytes_per_pixel + 24)
        deep, pixels = 1 if self.codes == "srgb8" else 2, self.size.width * self.size.height
        needed = 2 * deep * self.count * bytes_per_pixel * pixels
        free = shutil.disk_usage(folder).free
        if needed > free:
            problem = f"needs up to {needed / 1e9:,.0f} GB, and the disk has {free / 1e9:,.0f}"
            remedy = "Ask for fewer scenes or pixels"
            raise SettingsError(problem, file=folder, key="scenes", remedy=remedy)

    def batches(self) -> list[str]:
        """Return the names of all jobs, as in files."""
        return [f"{number:05d}" for number in range(-(-self.count // self.scenes_per_job))]

    def scenes_of(self, batch: str) -> range:
        """Return the scenes of a job."""
        start = int(batch) * self.scenes_per_job
        return range(start, min(start + self.scenes_per_job, self.count))


def _files(wanted: str | list[str], suffixes: tuple[str, ...], key: str) -> list[Path]:
    if not wanted:
        return []

    def paths() -> Iterator[Path]:
        for entry in [wanted] if isinstance(wanted, str) else wanted:
            path = Path(entry)
            if not path.exists():
                raise SettingsError("no such file or folder", file=path, key=key)
            if path.is_dir():
                yield from (p for p in path.iterdir() if p.suffix.lower() in suffixes)
            else:
                yield path

    files = sorted(paths(), key=lambda path: path.name)
    if not files:
        problem = f"has none of *{', *'.join(suffixes)}"
        raise SettingsError(problem, file=str(wanted), key=key, remedy="Name a folder with files")
    return files
