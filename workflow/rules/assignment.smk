# The light field camera of the assignment (CS348b, assignment 3): camera arrays as tiled EXR, and
# pictures, measurements and tables from them. `snakemake --cores 2 results/assignment/`
ARRAY = SETTINGS["assignment"]
ARRAYS = "results/assignment/arrays"
# Pictures of the page, in order: title, and the scripts' records that its caption speaks of.
ASSIGNMENT_FIGURES = {
    "light_fields": "Step 2: light fields",
    "synthesis": "Steps 3 and 4: pictures of the book",
    "see_through": "Step 4: seeing through trees",
    "focal_surfaces": "Step 5: focal surfaces",
    "realistic_lens": "Step 5: a realistic lens",
    "few_cameras": "Step 6: few cameras",
    "equal_storage": "Step 6: many cameras of few pixels",
    "time": "Step 6: time",
    "reconstruction": "Error, run time and convergence",
}
ASSIGNMENT_TABLES = {
    "camera_array": "Table: camera arrays",
    "reconstruction": "Table: reconstruction",
}
ASSIGNMENT_FILES = [
    *(f"results/assignment/figures/{figure}.png" for figure in ASSIGNMENT_FIGURES),
    *(
        f"results/assignment/{table}.{kind}"
        for table in ASSIGNMENT_TABLES
        for kind in ("csv", "md")
    ),
    "results/assignment/index.html",
    *(f"results/tables/{table}.{kind}" for table in ASSIGNMENT_TABLES for kind in ("csv", "md")),
]
# The quick ones of its scenes are in the tables of results/tables/, with its figure of errors.
QUICK_SCENES = ["book", "sphere"]
ERRORS_FIGURE = "results/assignment/figures/reconstruction.png"
if ARRAY["in_tables"]:
    for name, title in (
        ("camera_array", "Camera arrays"),
        ("reconstruction", "Pictures from camera arrays"),
    ):
        SECTIONS[name] = {"title": title, "table": f"results/tables/{name}.csv"}
    SECTIONS["reconstruction"]["figures"] = {"": ERRORS_FIGURE}
# Scripts, and the figures that each makes beside its record.
BOOK_FIGURES = ["synthesis", "focal_surfaces", "realistic_lens"]
SAMPLING_FIGURES = ["few_cameras", "equal_storage"]
ASSIGNMENT_RECORDS = ["book", "see_through", "sampling", "time", "reconstruction"]


rule assignment_trace:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        light_field=f"{ARRAYS}/{{scene}}.exr",
        record=f"{ARRAYS}/{{scene}}.json",
    log:
        "logs/assignment/trace/{scene}.log",
    wildcard_constraints:
        scene="|".join(ASSIGNMENT_SCENES),
    priority: 10
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("assignment_trace.py"),
        cameras_per_dim=ARRAY["cameras_per_dim"],
        tile_px=lambda wildcards: ARRAY["tile_px"][wildcards.scene],
        samples_per_pixel=lambda wildcards: ARRAY["samples_per_pixel"][wildcards.scene],
        device=SETTINGS["device"],
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
        sources=sources("assignment_light_fields.py"),
        scenes=list(ASSIGNMENT_SCENES),
    script:
        "../scripts/assignment_light_fields.py"


rule assignment_book:
    input:
        light_field=f"{ARRAYS}/book.exr",
        lens=f"{workflow.basedir}/scenes/lenses/double_gauss.dat",
    output:
        figures=[assignment_figure(name) for name in BOOK_FIGURES],
        record="results/assignment/records/book.json",
    log:
        "logs/assignment/book.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("assignment_book.py"),
        picture_px=ARRAY["picture_px"],
        device=SETTINGS["device"],
    script:
        "../scripts/assignment_book.py"


rule assignment_see_through:
    input:
        light_field=f"{ARRAYS}/ecosys.exr",
        scene="results/ecosys/scene.npz",
        bvh="results/ecosys/bvh.npz",
    output:
        figure=assignment_figure("see_through"),
        record="results/assignment/records/see_through.json",
    log:
        "logs/assignment/see_through.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("assignment_see_through.py"),
        picture_px=ARRAY["tile_px"]["ecosys"] * 3 // 2,
        reference_samples=ARRAY["reference_samples"]["ecosys"],
        device=SETTINGS["device"],
    script:
        "../scripts/assignment_see_through.py"


rule assignment_sampling:
    input:
        scene="results/book/scene.npz",
        bvh="results/book/bvh.npz",
    output:
        figures=[assignment_figure(name) for name in SAMPLING_FIGURES],
        record="results/assignment/records/sampling.json",
    log:
        "logs/assignment/sampling.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("assignment_sampling.py"),
        picture_px=ARRAY["picture_px"],
        tile_px=ARRAY["tile_px"]["book"],
        storage_px=ARRAY["storage_px"],
        reference_samples=ARRAY["reference_samples"]["book"],
        device=SETTINGS["device"],
    script:
        "../scripts/assignment_sampling.py"


rule assignment_time:
    input:
        scene=f"{workflow.basedir}/scenes/sphere/moving.pbrt",
    output:
        figure=assignment_figure("time"),
        record="results/assignment/records/time.json",
    log:
        "logs/assignment/time.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("assignment_time.py"),
        picture_px=ARRAY["picture_px"],
        instants=ARRAY["instants"],
        device=SETTINGS["device"],
    script:
        "../scripts/assignment_time.py"


rule assignment_reconstruction:
    input:
        scene="results/book/scene.npz",
        bvh="results/book/bvh.npz",
    output:
        figure=assignment_figure("reconstruction"),
        record="results/assignment/records/reconstruction.json",
    log:
        "logs/assignment/reconstruction.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("assignment_reconstruction.py"),
        picture_px=ARRAY["picture_px"],
        tile_px=ARRAY["tile_px"]["book"],
        camera_counts=ARRAY["camera_counts"],
        monte_carlo_samples=ARRAY["monte_carlo_samples"],
        reference_samples=ARRAY["reference_samples"]["book"],
        device=SETTINGS["device"],
    script:
        "../scripts/assignment_reconstruction.py"


rule assignment_tables:
    input:
        camera_array=expand(f"{ARRAYS}/{{scene}}.json", scene=ASSIGNMENT_SCENES),
        reconstruction="results/assignment/records/reconstruction.json",
        captions=[caption_of(f"assignment_table_{table}") for table in ASSIGNMENT_TABLES],
    output:
        csv=[f"results/assignment/{table}.csv" for table in ASSIGNMENT_TABLES],
        markdown=[f"results/assignment/{table}.md" for table in ASSIGNMENT_TABLES],
    log:
        "logs/assignment/tables.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("assignment_tables.py"),
        titles=ASSIGNMENT_TABLES,
        config=SETTINGS,
    script:
        "../scripts/assignment_tables.py"


rule array_tables:
    input:
        camera_array=expand(f"{ARRAYS}/{{scene}}.json", scene=QUICK_SCENES),
        reconstruction="results/assignment/records/reconstruction.json",
        captions=[caption_of(table) for table in ASSIGNMENT_TABLES],
    output:
        csv=[
            report(
                f"results/tables/{table}.csv",
                caption=f"../report/{table}.rst",
                category="Tables",
            )
            for table in ASSIGNMENT_TABLES
        ],
        markdown=[f"results/tables/{table}.md" for table in ASSIGNMENT_TABLES],
    log:
        "logs/array_tables.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("assignment_tables.py"),
        titles=ASSIGNMENT_TABLES,
        config=SETTINGS,
    script:
        "../scripts/assignment_tables.py"


rule assignment_page:
    input:
        figures=[f"results/assignment/figures/{figure}.png" for figure in ASSIGNMENT_FIGURES],
        tables=[f"results/assignment/{table}.csv" for table in ASSIGNMENT_TABLES],
        records=[f"results/assignment/records/{name}.json" for name in ASSIGNMENT_RECORDS],
        introduction=caption_of("assignment_page"),
        figure_captions=[caption_of(f"assignment_{figure}") for figure in ASSIGNMENT_FIGURES],
        table_captions=[caption_of(f"assignment_table_{table}") for table in ASSIGNMENT_TABLES],
    output:
        report(
            "results/assignment/index.html",
            caption="../report/assignment_figure.rst",
            category="Assignment",
            labels={"figure": "page"},
        ),
    log:
        "logs/assignment/page.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("assignment_page.py"),
        figures=ASSIGNMENT_FIGURES,
        tables=ASSIGNMENT_TABLES,
        records=ASSIGNMENT_RECORDS,
        config=SETTINGS,
    script:
        "../scripts/assignment_page.py"


# Two spellings of one folder, as for results/tables.
rule:
    name:
        "results/assignment"
    input:
        ASSIGNMENT_FILES,
    localrule: True


rule:
    name:
        "results/assignment/"
    input:
        ASSIGNMENT_FILES,
    localrule: True
