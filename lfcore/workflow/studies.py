"""The keys of the studies, each of which has a file in config/studies/."""

from typing import Any, Literal

from lfcore.workflow import keys
from lfcore.workflow.keys import Keys, above, group, key, listed, number, several, whole


class Plenoptic(Keys):
    lenses: whole(32, 2048) = key("microlenses per side of the photograph of the scene chart", 384)
    samples: whole(8, 64) = key("pixels per side behind each microlens", 16)


class Renderers(Keys):
    pixels: whole(32, 1024) = key(
        "pixels per side of the pictures by POV-Ray and Mitsuba 3, where they are installed", 192
    )
    views: whole(2, 64) = key(
        "lens samples per side of these pictures; the square is the number of rays per pixel", 12
    )


class Figures(Keys):
    views: whole(2, 1024) = key("lens samples per side of the sub-aperture views", 64)
    aperture_stops: listed(number(0, 20), 1, 12) = key(
        "stops by which the lens is closed in the aperture stack", [0, 1, 2, 3]
    )
    plenoptic: group(Plenoptic, "the plenoptic camera")
    renderers: group(Renderers, "the pictures by other ray tracers")


class StorageLayouts(Keys):
    views: several(whole(4, 512)) = key(
        "lens samples per side of the light fields that are stored in every layout", [16, 32, 64]
    )
    rays: whole(4096, 268435456) = key(
        "most rays of a sample: a window of pixels in the middle of the picture", 1638400
    )
    packs: several(whole(1, 64), 0) = key(
        "macropixels per side of a frame, beside the default", [1, 2, 4, 8]
    )


class RateDistortion(Keys):
    views: several(whole(4, 512)) = key("lens samples per side, one curve each", [16, 64])
    rays: whole(4096, 268435456) = key("most rays of a sample", 1638400)
    crfs: several(number(0, 42), 3, 12) = key(
        "constant rate factors of a curve, on H.264's scale", [18, 24, 30, 36]
    )


class Equivalence(Keys):
    pixels: whole(32, 1024) = key("pixels per side of the picture", 96)
    views: whole(2, 128) = key("lens samples per side of its light field", 16)
    reference_views: whole(8, 256) = key("lens samples per side of the reference", 64)


class Retrieval(Keys):
    planes: several(whole(1, 100)) = key("numbers of planes that are formed at once", [1, 10, 100])
    rays: whole(4096, 4294967296) = key("most rays that they are formed from", 16777216)
    repeats: whole(1, 20) = key("timed rounds per measurement", 2)


class Storage(Keys):
    storage_layouts: group(StorageLayouts, "samples stored in every layout")
    rate_distortion: group(RateDistortion, "curves of rate against distortion")
    equivalence: group(Equivalence, "one picture made in four ways")
    retrieval: group(Retrieval, "seconds to read a stored light field")


class Codec(Keys):
    name: str = key("name of the curve")
    codec: Literal["libx264", "libx265", "libsvtav1"] | None = key("encoder", None)
    preset: str | int | None = key("preset of the encoder", None)
    pixel_format: Literal["yuv420p", "yuv444p", "yuv420p10le", "yuv444p10le"] | None = key(
        "pixel format", None
    )
    crf_offset: number(-20, 20) = key("added to the CRF: AV1 has another scale", 0)


LATTICE = listed(number(1, 64), 2, 2)


class WorkPrecision(Keys):
    truth: several(LATTICE, 2, 2) = key(
        "two unlike lattices of the true picture: lens samples and rays per pixel, per side",
        [[10, 5], [8, 6]],
    )
    stops: above(0, 12) = key("stops by which the stopped-down lens is closed", 4)
    truth_stopped: several(LATTICE, 2, 2) = key("`truth` through that lens", [[6, 6], [5, 7]])
    nearest_views: several(whole(2, 1024), 1, 8) = key(
        "lens samples per side of the thesis's recipe through the stopped-down lens", [64]
    )
    lattices: several(LATTICE, 1, 12) = key(
        "lattices that are sliced by depth, on the fly and from files",
        [[4, 1], [4, 1.5], [4, 2], [8, 2]],
    )
    qualities_db: several(number(10, 80), 0, 12) = key(
        "PSNR in dB, as `lfcore render` takes it", [35, 40, 45]
    )
    peers_db: several(number(10, 80), 0, 4) = key(
        "PSNR in dB to which Mitsuba 3 and POV-Ray are timed, where they are installed", [40, 45]
    )
    codec_lattice: LATTICE = key("lattice that is stored by every codec", [4, 2])
    crfs: listed(number(0, 51), 0, 12) = key("constant rate factors per codec", [14, 22, 30])
    codecs: listed(Codec, 1, 5) = key(
        "encoders of stored light fields",
        [
            {"name": "default"},
            {"name": "x264 ultrafast", "preset": "ultrafast"},
            {"name": "x265 fast", "codec": "libx265", "preset": "fast", "pixel_format": "yuv444p"},
            {"name": "SVT-AV1 10", "codec": "libsvtav1", "preset": "10", "pixel_format": "yuv420p",
             "crf_offset": 10},
        ],
    )  # fmt: skip
    memory_views: several(whole(2, 256), 1) = key(
        "lens samples per side of light fields in memory", [8, 24]
    )
    monte_carlo_samples: listed(whole(1, 16384), 1, 8) = key(
        "samples per pixel of the Monte Carlo curve", [4, 16, 64]
    )


class ChosenRays(Keys):
    qualities_db: several(number(10, 80), 1, 8) = key(
        "PSNR in dB against the true picture for which a light field is recorded", [35, 40, 45]
    )


class LeftOut(Keys):
    views: whole(2, 256) = key("lens samples per side", 64)
    pixels: whole(16, 512) = key("pixels per side", 24)
    repeats: whole(1, 20) = key("timed runs per program", 3)
    features: Literal["all"] | several(
        str, 0
    ) = key("features that the scene lacks and that are compiled in to compare", "all")


class Analysis(Keys):
    stability_rays: whole(100, 1000000) = key("rays per step of a stability sweep", 400)
    stability_cases: Literal["all"] | several(str) = key("stability sweeps to run", "all")
    work_precision: group(WorkPrecision, "error against run time")
    chosen_rays: group(ChosenRays, "light fields whose rays are chosen for a quality")
    left_out: group(LeftOut, "runs of the complete program for comparison")


class Array(Keys):
    bounds_m: listed(float, 4, 4) = key("minX maxX minY maxY of the camera grid, metres, y up")
    fov_deg: above(0, 179) = key("field of view of a data camera, degrees")


ARRAYS: dict[str, dict[str, Any]] = {
    "book": {"bounds_m": [-0.6, 0.6, -0.6, 0.6], "fov_deg": 50},
    "sphere": {"bounds_m": [-0.6, 0.6, -0.6, 0.6], "fov_deg": 50},
    "ecosys": {"bounds_m": [-2.5, 2.5, -1.5, 1.5], "fov_deg": 60},
}
"""The assignment's own camera grids."""


class SeeThrough(Keys):
    scene: str = key("scene of the study, one of `assignment.scenes`", "ecosys")
    focus_m: listed(above(0), 2) = key(
        "focus distances in metres; the first sees through the others", [60.0, 12.0, 19.0]
    )
    lens_m: listed(above(0), 2) = key("radius of the lens at each of them", [1.4, 0.4, 0.6])
    names: listed(str, 2) = key(
        "the object in focus at each of them", ["hillside", "first tree", "second tree"]
    )


class Assignment(Keys):
    scenes: several(keys.Scene) = key(
        "scenes of camera arrays; each has a `camera.lightfield` or an entry in `arrays`",
        ["book", "sphere", "ecosys"],
    )
    arrays: dict[str, Array] = key("camera grids of scenes without one of their own", ARRAYS)
    cameras_per_dim: whole(2, 256) = key("data cameras per side of these grids", 16)
    tile_px: dict[str, whole(16, 4096)] = key(
        "pixels per side of a data camera, by scene; others take their film's",
        {"book": 128, "sphere": 64, "ecosys": 64},
    )
    samples_per_pixel: dict[str, whole(1, 1024)] = key(
        "rays per pixel of a data camera, by scene; 1 for others",
        {"book": 4, "sphere": 4, "ecosys": 1},
    )
    picture_px: whole(16, 4096) = key("pixels per side of pictures from the arrays", 200)
    camera_counts: several(whole(2, 128)) = key(
        "data cameras per side in the table of reconstructions", [2, 4, 8, 16, 32]
    )
    monte_carlo_samples: several(whole(1, 65536), 2) = key(
        "rays per pixel of Monte Carlo in that table", [4, 16, 64, 256]
    )
    convergence_samples: several(whole(1, 65536), 2) = key(
        "rays per pixel of the curves of its convergence", [4, 16, 64, 256]
    )
    reference_samples: dict[str, whole(1, 65536)] = key(
        "rays per pixel of the directly traced thin lens, by scene; 64 for others",
        {"book": 1024, "ecosys": 64},
    )
    storage_px: whole(128, 16384) = key(
        "pixels per side of the arrays that are compared at equal storage", 1024
    )
    instants: whole(2, 1024) = key("instants at which the open shutter is sampled", 16)
    see_through: group(SeeThrough, "seeing through an obstacle")


class Configuration(keys.Configuration):
    """The configuration of a run: the keys that a user sets, and those of the studies."""

    figures: group(Figures, "Figures of the thesis")
    storage: group(Storage, "Reports on the stored light field")
    analysis: group(Analysis, "Reports on the program itself")
    assignment: group(Assignment, "The light field camera's arrays, pictures and measurements")


STUDIES = ("figures", "storage", "analysis", "assignment")
