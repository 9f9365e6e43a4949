# The light field camera of the assignment (CS348b, assignment 3): camera arrays as tiled EXR, and
# pictures, measurements and tables from them. `snakemake --cores 2 results/assignment/`
ARRAY = SETTINGS["camera_array"]
ARRAYS = "results/assignment/arrays"
RECORDS = "results/assignment/records"
ASSIGNMENT_SCENES = ARRAY["scenes"]
# The fast scenes, which are in results/tables/, too.
QUICK_SCENES = [scene for scene in ASSIGNMENT_SCENES if scene in ("book", "sphere")]
SEEN_THROUGH = ARRAY["see_through"]["scene"]


rule assignment_trace:
    input:
        **of_scene("{scene}"),
    output:
        light_field=f"{ARRAYS}/{{scene}}.exr",
        record=f"{ARRAYS}/{{scene}}.json",
    log:
        "logs/assignment/trace/{scene}.log",
    wildcard_constraints:
        scene="|".join(map(re.escape, ASSIGNMENT_SCENES)),
    priority: LONG
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("assignment_trace"),
        cameras_per_dim=ARRAY["cameras_per_dim"],
        grid=lambda wildcards: ARRAY["arrays"].get(wildcards.scene),
        tile_px=lambda wildcards: ARRAY["tile_px"].get(wildcards.scene),
        samples_per_pixel=lambda wildcards: ARRAY["samples_per_pixel"].get(wildcards.scene, 1),
        device=DEVICE,
    script:
        "../scripts/assignment_trace.py"


rule assignment_light_fields:
    input:
        expand(f"{ARRAYS}/{{scene}}.exr", scene=ASSIGNMENT_SCENES),
    output:
        assignment_figure("light_fields"),
    log:
        "logs/assignment/light_fields.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("assignment_light_fields"),
        scenes=ASSIGNMENT_SCENES,
    script:
        "../scripts/assignment_light_fields.py"


OF_BOOK = {
    "grid": ARRAY["arrays"].get("book"),
    "picture_px": ARRAY["picture_px"],
    "tile_px": ARRAY["tile_px"].get("book", 64),
    "reference_samples": ARRAY["reference_samples"].get("book", 64),
}
# The files, figures and settings of each study.
STUDIES = {
    "book": (
        {"light_field": f"{ARRAYS}/book.exr", "lens": book_lens},
        BOOK_FIGURES,
        {"picture_px": ARRAY["picture_px"]},
    ),
    "see_through": (
        {**of_scene(SEEN_THROUGH), "light_field": f"{ARRAYS}/{SEEN_THROUGH}.exr"},
        ["see_through"],
        {
            "study": ARRAY["see_through"],
            "picture_px": ARRAY["tile_px"].get(SEEN_THROUGH, 64) * 3 // 2,
            "reference_samples": ARRAY["reference_samples"].get(SEEN_THROUGH, 64),
        },
    ),
    "sampling": (
        of_scene("book"),
        SAMPLING_FIGURES,
        OF_BOOK | {"storage_px": ARRAY["storage_px"]},
    ),
    "time": (
        {"files": moving_sphere},
        ["time"],
        {"picture_px": ARRAY["picture_px"], "instants": ARRAY["instants"]},
    ),
    "reconstruction": (
        of_scene("book"),
        ["reconstruction"],
        OF_BOOK
        | {
            "camera_counts": ARRAY["camera_counts"],
            "monte_carlo_samples": ARRAY["monte_carlo_samples"],
            "convergence_samples": ARRAY["convergence_samples"],
        },
    ),
}

for name, (files, figures, settings) in STUDIES.items():

    rule:
        name:
            f"assignment_{name}"
        input:
            **files,
        output:
            figures=[assignment_figure(figure) for figure in figures],
            record=f"{RECORDS}/{name}.json",
        log:
            f"logs/assignment/{name}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("assignment_study"),
            study=name,
            settings=settings,
            device=DEVICE,
        script:
            "../scripts/assignment_study.py"


rule assignment_tables:
    input:
        camera_array=expand(f"{ARRAYS}/{{scene}}.json", scene=ASSIGNMENT_SCENES),
        reconstruction=f"{RECORDS}/reconstruction.json",
    output:
        camera_array="results/assignment/camera_array.csv",
        reconstruction="results/assignment/reconstruction.csv",
    log:
        "logs/assignment/tables.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("assignment_tables"),
    script:
        "../scripts/assignment_tables.py"


use rule assignment_tables as array_tables with:
    input:
        camera_array=expand(f"{ARRAYS}/{{scene}}.json", scene=QUICK_SCENES),
        reconstruction=f"{RECORDS}/reconstruction.json",
    output:
        camera_array=table("camera_array"),
        reconstruction=table("reconstruction"),
    log:
        "logs/array_tables.log",
