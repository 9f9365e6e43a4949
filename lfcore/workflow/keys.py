"""Every key of the configuration: its type, bounds, default and meaning, once.

``python -m lfcore.workflow.settings`` writes from here what stands elsewhere: the schema, the
default configuration, and the table of config/README.md.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field
from pydantic_core import PydanticCustomError

from lfcore.workflow.key_types import (
    GivenKeys,
    Keys,
    Name,
    NameOrNone,
    Truth,
    choices,
    group,
    key,
    listed,
    number,
    real,
    several,
    whole,
)


class Plane(GivenKeys):
    focus_m: number(gt=0) = key("what is in focus, metres, beyond the focal length")
    f_number: number(gt=0) = key(
        "focal length over aperture, no wider than the lens; default is the lens's own", None
    )
    aperture: Literal["circle", "square", "diamond", "polygon"] = key("its shape", "circle")
    blades: whole(3, 32) = key("corners of a polygon", 6)
    rotation_deg: number() = key("degrees by which a polygon is turned", 0)
    normalise: Literal["aperture", "lens"] = key(
        "divide by the open lens samples, or by all (the picture dims as the lens closes)",
        "aperture",
    )
    keep_magnification: Truth = key("keep the physical sensor's change of magnification", False)


class Layout(Keys):
    kind: Literal["auto", "macropixels", "views"] = key(
        "what a video frame holds: all lens samples of a pixel (macropixels), all pixels of a lens "
        "sample (views), or what measured best at this N and M (auto)",
        "auto",
    )
    order: Literal["raster", "serpentine", "hilbert"] = key(
        "order of the frames of a tile", "serpentine"
    )
    pack: Literal["auto"] | whole(1, 64) = key(
        "macropixels (or views) a side that share a frame; auto makes frames of about 128 pixels a "
        "side from smaller macropixels",
        "auto",
    )


class Encoder(Keys):
    codec: Literal["libx264", "libx265", "libsvtav1", "ffv1"] = key(
        "H.264, H.265 (in frames of more than 64 pixels a side), AV1 or lossless FFV1", "libx264"
    )
    pixel_format: Literal["auto", "yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le", "gbrp"] = key(
        "with or without subsampled colour, in 8 or 10 bits, or RGB itself; AV1 takes `yuv420p` "
        "and `yuv420p10le` only, `gbrp` is FFV1's alone; auto is 4:4:4 where the codec has it",
        "auto",
    )
    crf: Literal["auto"] | real(0, 63) = key(
        "constant rate factor: lower is better and larger; auto is by N; FFV1 does not use it",
        "auto",
    )
    preset: NameOrNone = key(
        "the codec's own name of a compromise of speed and size, null, or auto: by N", "auto"
    )
    tune: NameOrNone = key("what the codec optimises: psnr, ssim, null", "psnr")


FIGURES = (
    "focal_stack", "aperture_stack", "sub_aperture_views", "plenoptic_photograph",
    "other_renderers", "quality",
)  # fmt: skip


class Plenoptic(Keys):
    lenses: whole(32, 2048) = key("microlenses a side of the photograph of the scene `chart`", 512)
    samples: whole(8, 64) = key(
        "pixels a side behind each microlens; the photograph has `lenses` times `samples` a side",
        16,
    )


class Renderers(Keys):
    pixels: whole(32, 1024) = key(
        "pixels a side of the pictures that POV-Ray and Mitsuba 3 make of `chart`, where they are "
        "installed",
        192,
    )
    views: whole(2, 64) = key(
        "lens samples a side of these pictures; the square is the rays of a pixel", 12
    )


class Figures(Keys):
    make: choices(*FIGURES) = key("figures to make", list(FIGURES))
    angular_resolution: whole(2, 1024) = key(
        "N of aperture stack and sub-aperture views, which are traced for themselves", 64
    )
    aperture_stops: listed(real(0, 20), 1, 12) = key(
        "stops by which the lens is closed in the aperture stack", [0, 1, 2, 3]
    )
    plenoptic: group(Plenoptic, "The plenoptic camera of the photograph")
    renderers: group(Renderers, "The pictures that other ray tracers make, too")


REPORTS_ON_THE_STORE = ("storage_layouts", "rate_distortion", "equivalence", "retrieval")


class StorageLayouts(Keys):
    views: several(whole(4, 512)) = key(
        "N of the light fields that are stored in every layout", [16, 32, 64]
    )
    rays: whole(4096, 268435456) = key(
        "most rays of a sample: a window of pixels in the middle of the picture", 2359296
    )
    packs: several(whole(1, 64), 0) = key(
        "macropixels a side of a frame, beside the default", [1, 2, 4, 8]
    )


class RateDistortion(Keys):
    views: several(whole(4, 512)) = key("N of the curves of bits against error", [16, 64])
    rays: whole(4096, 268435456) = key("most rays of a sample", 2359296)
    crfs: several(real(0, 42), 3, 12) = key(
        "constant rate factors of a curve, H.264's scale", [18, 24, 30, 36]
    )


class Equivalence(Keys):
    pixels: whole(32, 1024) = key("M of the picture that is made in four ways", 96)
    views: whole(2, 128) = key("N of the light field that it is made of", 16)
    reference_views: whole(8, 256) = key(
        "N of the reference picture; the square is the rays of a pixel", 64
    )


class Retrieval(Keys):
    planes: several(whole(1, 100)) = key("how many planes are formed at once", [1, 10, 100])
    rays: whole(4096, 4294967296) = key(
        "most rays of the stored light field that they are formed from", 33554432
    )
    repeats: whole(1, 20) = key("timed rounds of each measurement", 2)


class Storage(Keys):
    make: choices(*REPORTS_ON_THE_STORE) = key(
        "reports on the store; `retrieval` needs `store`", list(REPORTS_ON_THE_STORE)
    )
    storage_layouts: group(StorageLayouts, "Samples stored in every layout")
    rate_distortion: group(RateDistortion, "Curves of bits against error")
    equivalence: group(Equivalence, "Pictures that are made in four ways")
    retrieval: group(Retrieval, "What is read from stored light fields")


class Codec(GivenKeys):
    name: str = key("name of the curve")
    codec: Literal["libx264", "libx265", "libsvtav1"] = key("encoder", "libx264")
    preset: Name = key("the encoder's own", None)
    pixel_format: Literal["yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le"] = key("", None)
    crf_offset: real(-20, 20) = key("added to the CRF; AV1's scale is another", 0)


LATTICE = listed(real(1, 64), 2, 2)


class WorkPrecision(Keys):
    pixels: whole(16, 512) = key("M of the diagrams of error against run time", 24)
    views: several(whole(2, 256), 2) = key(
        "N of the points of these diagrams, ascending", [4, 8, 16, 32, 64, 128]
    )
    window_picture: whole(64, 1024) = key(
        "M of the picture whose windows the lens integral is studied in", 128
    )
    window_truth: several(listed(whole(1, 256), 2, 2), 2, 2) = key(
        "two unlike lattices of the true windows: lens samples and rays of a pixel, a side",
        [[48, 4], [40, 5]],
    )
    truth: several(LATTICE, 2, 2) = key(
        "two unlike lattices of the true refocused picture", [[10, 8], [8, 10]]
    )
    f_stops: listed(real(0, 12), 1, 4) = key(
        "stops by which the lens is closed, a diagram each", [0, 2, 4]
    )
    stored_pixels: whole(16, 512) = key("M of the pictures of stored light fields", 64)
    stored_lattice: LATTICE = key(
        "rays that are stored with their depths: lens samples and rays of a pixel, a side", [4, 2]
    )
    video_views: whole(2, 256) = key("N of the grid that is stored without depths", 32)
    crfs: listed(real(0, 51), 1, 12) = key(
        "constant rate factors of the points of the storage diagram", [14, 20, 26, 30, 34, 40]
    )
    codecs: listed(Codec, 1, 5) = key(
        "encoders of the storage diagram: `name`, and `codec`, `preset`, `pixel_format`, "
        "`crf_offset` where they are not the default's",
        [
            {"name": "default"},
            {"name": "x264 ultrafast", "preset": "ultrafast"},
            {"name": "x264 veryfast 4:2:0", "preset": "veryfast", "pixel_format": "yuv420p"},
            {"name": "x265 fast", "codec": "libx265", "preset": "fast", "pixel_format": "yuv444p"},
            {"name": "SVT-AV1 10", "codec": "libsvtav1", "preset": "10", "pixel_format": "yuv420p",
             "crf_offset": 10},
        ],
    )  # fmt: skip
    monte_carlo_samples: listed(whole(1, 16384), 1, 8) = key(
        "samples a pixel of the Monte Carlo curve", [4, 16, 64, 256]
    )
    oracle_pixels: whole(1, 64) = key("pixels whose rays the oracle traces", 4)
    oracle_views: whole(1, 32) = key("N of the rays that the oracle traces", 8)


class TruePicture(Keys):
    truth: several(LATTICE, 2, 2) = key(
        "two unlike lattices of the true picture: lens samples and rays of a pixel, a side",
        [[10, 5], [8, 6]],
    )
    lattices: several(LATTICE, 1, 12) = key(
        "lattices that are sliced by depth",
        [[4, 1], [4, 1.25], [4, 1.5], [4, 2], [6, 2], [8, 2], [8, 3]],
    )
    qualities_db: several(real(10, 80), 0, 12) = key(
        "PSNR in dB that is asked for, as of `lfcore render --quality-db`", [35, 40, 45, 50]
    )
    peers_db: several(real(10, 80), 0, 4) = key(
        "PSNR in dB to which Mitsuba 3 and POV-Ray are timed where they are installed; those of "
        "`qualities_db` among them are asked for one picture, too",
        [40, 45],
    )
    nearest_views: several(whole(2, 1024), 1, 8) = key(
        "N of the thesis's recipe through the stopped-down lens", [16, 64]
    )
    stops: number(gt=0, le=12) = key("stops by which the stopped-down lens is closed", 4)


class LeftOut(Keys):
    views: whole(2, 256) = key("N of the runs that compare with the program in full", 64)
    pixels: whole(16, 512) = key("M of these runs", 32)
    repeats: whole(1, 20) = key("timed runs of each program", 5)
    features: Literal["all"] | several(str, 0) = key(
        "which of the features that a scene lacks are compiled in to compare: `all`, or names",
        "all",
    )


ANALYSES = ("true_picture", "work_precision", "recommendation", "stability", "left_out")


class Analysis(Keys):
    make: choices(*ANALYSES) = key("reports on the program itself", list(ANALYSES))
    targets_db: listed(real(1, 100), 1, 12) = key(
        "PSNR in dB for which settings are recommended", [35, 40, 45, 50]
    )
    stability_rays: whole(100, 1000000) = key("rays of a step of a stability sweep", 400)
    stability_cases: Literal["all"] | several(
        str
    ) = key("which stability sweeps are run: `all`, or names", "all")
    true_picture: group(TruePicture, "Pictures against their average over pixel and lens")
    work_precision: group(WorkPrecision, "Diagrams of error against run time")
    left_out: group(LeftOut, "Runs that compare with the program in full")


class Array(Keys):
    bounds_m: listed(number(), 4, 4) = key("minX maxX minY maxY of the camera grid, metres, y up")
    fov_deg: number(gt=0, lt=180) = key("field of view of a data camera, degrees")


ARRAYS: dict[str, dict[str, Any]] = {
    "book": {"bounds_m": [-0.6, 0.6, -0.6, 0.6], "fov_deg": 50},
    "sphere": {"bounds_m": [-0.6, 0.6, -0.6, 0.6], "fov_deg": 50},
    "ecosys": {"bounds_m": [-2.5, 2.5, -1.5, 1.5], "fov_deg": 60},
}
"""The assignment's own camera grids."""


class SeeThrough(Keys):
    scene: str = key("scene of the study, one of `assignment.scenes`", "ecosys")
    focus_m: listed(number(gt=0), 2) = key(
        "focus distances: first what is seen through the others", [60.0, 12.0, 19.0]
    )
    lens_m: listed(number(gt=0), 2) = key(
        "radius of the lens at each of these distances, metres", [1.4, 0.4, 0.6]
    )
    names: listed(str, 2) = key(
        "what is in focus at each of these distances", ["hillside", "first tree", "second tree"]
    )


class Assignment(Keys):
    in_tables: Truth = key(
        "tables of camera arrays and reconstructions in `results/tables/`, too", True
    )
    scenes: several(str) = key(
        "`results/assignment/`: scenes of camera arrays, names or paths; each has a "
        "`camera.lightfield` of its own or an entry in `arrays`",
        ["book", "sphere", "ecosys"],
    )
    arrays: dict[str, Array] = key(
        "camera grids of scenes without one of their own: `bounds_m` (minX maxX minY maxY) and "
        "`fov_deg`",
        ARRAYS,
    )
    cameras_per_dim: whole(2, 256) = key("data cameras a side, where `arrays` says the grid", 16)
    tile_px: dict[str, whole(16, 4096)] = key(
        "pixels a side of a data camera, by scene; others take their film's",
        {"book": 128, "sphere": 64, "ecosys": 64},
    )
    samples_per_pixel: dict[str, whole(1, 1024)] = key(
        "rays a pixel of a data camera, by scene; 1 for others",
        {"book": 4, "sphere": 4, "ecosys": 1},
    )
    picture_px: whole(16, 4096) = key("pixels a side of pictures from the arrays", 200)
    camera_counts: several(whole(2, 128)) = key(
        "data cameras a side in the table of reconstructions", [2, 4, 8, 16, 32, 64]
    )
    monte_carlo_samples: several(whole(1, 65536), 2) = key(
        "rays a pixel of Monte Carlo in that table", [4, 16, 64, 256]
    )
    convergence_samples: several(whole(1, 65536), 2) = key(
        "rays a pixel of the curves of its convergence", [4, 16, 64, 256]
    )
    reference_samples: dict[str, whole(1, 65536)] = key(
        "rays a pixel of the directly traced thin lens, by scene; 64 for others",
        {"book": 1024, "ecosys": 64},
    )
    storage_px: whole(128, 16384) = key(
        "pixels a side of the arrays that are compared at equal storage", 1024
    )
    instants: whole(2, 1024) = key("instants at which the open shutter is sampled", 16)
    see_through: group(SeeThrough, "Seeing through what stands in front")


def _scene_or_planes(value: object) -> object:
    if isinstance(value, str) and value != "scene":
        raise PydanticCustomError("neither", "is neither 'scene' nor a list of planes")
    return value


class Configuration(Keys):
    """Configuration of a run."""

    scenes: several(Annotated[str, Field(min_length=1)]) = key(
        "what is traced: names of folders below `scenes/`, or paths of scene or mesh files"
    )
    angular_resolutions: several(whole(2, 1024)) = key(
        "N, lens samples a side", [16, 32, 64, 128, 256, 512]
    )
    angular_resolution: Literal["none", "auto"] = key(
        "`auto`: one more light field of each scene, with depths, whose lens samples and rays of a "
        "pixel a pilot of about a tenth of them picks, so that the worst of `planes` reaches "
        "`quality_db`",
        "none",
    )
    quality_db: real(10, 80) = key(
        "PSNR in dB against the true picture, averaged over pixel and lens, that it is to reach "
        "before its codec",
        45,
    )
    spatial_resolution: whole(16, 8192) = key("M, pixels a side", 128)
    planes: Annotated[
        Literal["scene"] | listed(Plane, 1, 100),
        BeforeValidator(_scene_or_planes),
    ] = key(
        "the pictures to form: `scene` (the scene's own focus distances, open round lens) or a "
        "list of 1 to 100 planes",
        "scene",
    )
    picture_format: Literal["png", "ppm"] = key("format of the planes' pictures, png or ppm", "png")
    store: Truth = key(
        "keep the light field as video; false leaves out encoding, joining, retrieval, tables 7.2 "
        "and 7.3",
        True,
    )
    layout: group(Layout, "How rays are laid out in video frames")
    encoder: group(Encoder, "Settings of the video codec")
    tile_mib: whole(1, 65536) = key(
        "raw 8-bit RGB of one tile, MiB; a tile is a segment, which is checked as a whole when it "
        "is read",
        1024,
    )
    job_minutes: number(gt=0, le=1440) = key(
        "core minutes of tracing that a job should take, so that it takes as many tiles; this "
        "bounds what a killed run loses",
        2,
    )
    device: str = key("part of an OpenCL device's or platform's name; empty: the processor", "")
    sweep: str = key(
        "a table of cases, whose light fields are made by `make sweep`; empty: none", ""
    )
    figures: group(Figures, "Which figures are made, and of what")
    storage: group(Storage, "Reports on the stored light field")
    analysis: group(Analysis, "Reports on the program itself")
    assignment: group(Assignment, "The light field camera's arrays, pictures and measurements")


DEFAULT_SCENES = ("bike", "cabin", "bedroom")
