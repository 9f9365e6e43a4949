"""Every key of the configuration: its type, bounds, default and meaning.

From these, ``python -m lfcore.workflow.settings`` writes the schema for the workflow's validation,
the default configuration, and the table of config/README.md.
"""

from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field


class Keys(BaseModel):
    """The keys of a mapping; others are refused."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False, validate_default=True)


def whole(low: int, high: int) -> Any:
    return Annotated[int, Field(ge=low, le=high)]


def number(low: float, high: float) -> Any:
    return Annotated[float, Field(ge=low, le=high)]


def above(low: float, high: float | None = None) -> Any:
    return Annotated[float, Field(gt=low, le=high)]


def listed(item: Any, least: int, most: int) -> Any:
    """Return the type of a list whose items may repeat."""
    return Annotated[list[item], Field(min_length=least, max_length=most)]


SIDES = Annotated[str, Field(pattern=r"^[1-9]\d{1,3}x[1-9]\d{1,3}$")]
"""A width and a height such as ``1920x1080``."""
Share = Annotated[str, Field(pattern=r"^[0-9.]+%$")]
"""A share such as ``40%``."""


def _distinct(values: list) -> list:
    if any(value in values[:place] for place, value in enumerate(values)):
        raise ValueError("has an entry twice")
    return values


def several(item: Any, least: int = 1) -> Any:
    """Return the type of a list of distinct items."""
    unique = Field(min_length=least, json_schema_extra={"uniqueItems": True})
    return Annotated[list[item], AfterValidator(_distinct), unique]


def key(meaning: str, default: Any = ...) -> Any:
    """Return a field with the meaning and default of a key."""
    return Field(default, description=meaning)


def group(model: type[Keys], meaning: str) -> Any:
    """Return the type of a mapping whose keys all have defaults."""
    empty: dict[str, Any] = {"default": {}}
    return Annotated[
        model, Field(description=meaning, default_factory=model, json_schema_extra=empty)
    ]


def _text(value: Any) -> Any:
    return str(value) if isinstance(value, int) and not isinstance(value, bool) else value


Scene = Annotated[str, BeforeValidator(_text), Field(min_length=1)]
"""A scene's name or path; in YAML a name such as 2024 is a number."""


class Plane(Keys):
    focus_m: above(0) | Share | Literal["near", "middle", "far"] = key(
        "focus distance in metres, beyond the focal length; or near, middle, far or a share such "
        "as 40% of the way from the scene's first focus distance to its last, even in dioptres"
    )
    f_number: above(0) | None = key(
        "focal length over the diameter of the aperture, no wider than the lens; null: the lens's",
        None,
    )
    blur: Share | None = key(
        "instead of f_number, the diameter of the blur at the focus distance that is more out of "
        "focus, a share of the picture's shorter side such as 3%",
        None,
    )
    aperture: Literal["circle", "square", "diamond", "polygon"] = key("its outline", "circle")
    blades: whole(3, 32) = key("corners of a polygon", 6)
    rotation_deg: float = key("rotation of a polygon, degrees", 0)
    normalise: Literal["aperture", "lens"] = key(
        "divide by the lens samples inside the aperture, or by all (a smaller aperture is darker)",
        "aperture",
    )
    keep_magnification: bool = key("keep the change of magnification of a physical sensor", False)


class Layout(Keys):
    kind: Literal["macropixels", "views"] | None = key(
        "content of a video frame: all lens samples of a pixel (macropixels) or all pixels of a "
        "lens sample (views); null: by `views` and `pixels`",
        None,
    )
    order: Literal["raster", "serpentine", "hilbert"] = key(
        "order of the frames of a tile", "serpentine"
    )
    pack: whole(1, 64) | None = key(
        "macropixels (or views) per side that share a frame; null: frames of about 128 pixels", None
    )


class Encoding(Keys):
    codec: Literal["libx264", "libx265", "libsvtav1", "ffv1"] = key(
        "H.264, H.265 (frames of more than 64 pixels per side), AV1 or lossless FFV1", "libx264"
    )
    pixel_format: Literal["yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le", "gbrp"] | None = key(
        "AV1 takes `yuv420p` and `yuv420p10le` only, `gbrp` is for FFV1; null: 4:4:4 where the "
        "codec has it",
        None,
    )
    crf: number(0, 63) | None = key("constant rate factor, lower is better; null: by `views`", None)
    preset: str | int | None = key(
        "the codec's name for speed against size; null: by `views`", None
    )
    tune: str | None = key("the codec's name for its target; null: none", "psnr")


class Film(Keys):
    frames: whole(0, 10**6) = key("number of instants; 0: no film", 0)
    fps: above(0, 10**6) = key("instants per second", 24)
    shutter_s: listed(number(-1e6, 1e6), 2, 2) = key(
        "when the shutter opens and closes, seconds from each instant; twice the same: at once",
        [0, 0],
    )


DEFAULT_SCENES = ["bike", "cabin", "bedroom"]


class Configuration(Keys):
    """The configuration of a run."""

    scenes: several(Scene) = key(
        "names of folders below `scenes/`, or paths of scene or mesh files; in results, `_` takes "
        "the place of spaces and the like in their names",
        DEFAULT_SCENES,
    )
    views: several(whole(2, 1024)) = key(
        "lens samples per side (N), one light field each", [16, 32, 64, 128, 256, 512]
    )
    pixels: whole(16, 8192) | SIDES = key(
        "pixels per side (M), or a width and height such as 1920x1080", 128
    )
    planes: Literal["scene"] | listed(Plane, 1, 100) = key(
        "pictures to form: `scene` (at the scene's own focus distances, wide open) or a list of "
        "planes",
        "scene",
    )
    picture_format: Literal["png", "ppm"] = key("format of these pictures", "png")
    store: bool = key("keep the light field as a video; false leaves out tables 7.2 and 7.3", True)
    layout: group(Layout, "order of the rays in video frames")
    encoding: group(Encoding, "settings of the video codec")
    tile_mib: whole(1, 65536) = key(
        "raw 8-bit RGB per tile in MiB; a tile is a segment of the video", 1024
    )
    job_minutes: above(0, 1440) = key(
        "core minutes of tracing per job; a killed run loses no more", 2
    )
    device: str = key("part of an OpenCL device's or platform's name; empty: the processor", "")
    film: group(Film, "a film of light fields of each scene, which all move, for the target films")
    sweep: str = key("a table of cases for the target `sweep`; empty: none", "")
    dataset: dict[str, Any] = key(
        "a data set to make, as `config/datasets/` has them (docs/tutorials/datasets.md); empty: "
        "none",
        {},
    )
    reports: Literal["all"] | several(str, 0) = key(
        "all reports beside the thesis's tables, or names from workflow/reports.yaml, `quality` "
        "(curves of the tables) and `camera_arrays`",
        "all",
    )
    studies: Literal["default", "thesis", "smoke", "micro"] = key(
        "the size of these reports' measurements (workflow/reports.yaml)", "default"
    )
