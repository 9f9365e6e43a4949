# Reports on the program itself: error against run time, chosen rays, stability, specialised programs.
STUDY = SETTINGS["work_precision"]
TRUTHS = {
    "wide": "results/{scene}/analysis/truth_wide.npz",
    "stopped": "results/{scene}/analysis/truth_stopped.npz",
}
CHOSEN = f"results/{{scene}}/M{PIXELS}/chosen"
CHOSEN_FIELDS = [f"{CHOSEN}/{db}dB.mkv" for db in SETTINGS["chosen_rays"]["qualities_db"]]


# True pictures, averaged over pixel and lens, once per scene.
rule truth:
    input:
        **of_scene("{scene}"),
    output:
        "results/{scene}/analysis/truth_{lens}.npz",
    log:
        "logs/truth/{scene}/{lens}.log",
    wildcard_constraints:
        lens="|".join(TRUTHS),
    priority: FIRST
    group:
        grouped("figures")
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("truth"),
        lattices=lambda wildcards: STUDY["truth" if wildcards.lens == "wide" else "truth_stopped"],
        stops=lambda wildcards: STUDY["stops"] if wildcards.lens == "stopped" else 0,
        planes=config["planes"],
        pixels=PIXELS,
        device=DEVICE,
    script:
        "../scripts/truth.py"


rule work_precision_scene:
    input:
        **TRUTHS,
        **of_scene("{scene}"),
        **TRACED,
        **STORED,
    output:
        "results/{scene}/analysis/work_precision.json",
    log:
        "logs/work_precision/{scene}.log",
    priority: LONG
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("work_precision_scene"),
        study=STUDY,
        views=VIEWS,
        device=DEVICE,
    script:
        "../scripts/work_precision_scene.py"


rule work_precision:
    input:
        of_scenes("analysis/work_precision.json"),
    output:
        csv=table("work_precision"),
        on_the_fly="results/tables/figures/work_precision_on_the_fly.png",
        stored="results/tables/figures/work_precision_stored.png",
    log:
        "logs/work_precision.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("work_precision"),
    script:
        "../scripts/work_precision.py"


if STORE:

    rule chosen_rays_scene:
        input:
            **of_scene("{scene}"),
            **{name: files[-1] for name, files in (TRACED | STORED).items()},
            truth=TRUTHS["wide"],
        output:
            rows=f"{CHOSEN}/chosen_rays.json",
            light_fields=CHOSEN_FIELDS,
        log:
            "logs/chosen_rays/{scene}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("chosen_rays_scene"),
            views=VIEWS[-1],
            qualities_db=SETTINGS["chosen_rays"]["qualities_db"],
            device=DEVICE,
        script:
            "../scripts/chosen_rays_scene.py"


rule stability:
    output:
        csv=table("stability"),
        cases="results/tables/stability_cases.csv",
        heat_map="results/tables/figures/stability_heat_map.png",
        error_growth="results/tables/figures/stability_error_growth.png",
    log:
        "logs/stability.log",
    priority: LONG
    conda:
        "../envs/lfcore.yaml"
    params:
        **SETTINGS["stability"],
        version=version("stability"),
        device=DEVICE,
    script:
        "../scripts/stability.py"


# Tables of all scenes' rows; two have a figure of all scenes.
for name, rows, light_fields, figures in (
    (
        "storage_layouts",
        "storage/storage_layouts.json",
        [],
        ["results/tables/figures/storage_layouts.png"],
    ),
    ("retrieval", "storage/retrieval.json", [], ["results/tables/figures/retrieval.png"]),
    ("equivalence", "storage/equivalence.json", [], []),
    # A new quality has no file yet, which runs the scenes' jobs again.
    ("chosen_rays", f"M{PIXELS}/chosen/chosen_rays.json", expand(CHOSEN_FIELDS, scene=SCENES), []),
):

    rule:
        name:
            name
        input:
            rows=of_scenes(rows),
            light_fields=light_fields,
        output:
            csv=table(name),
            figures=figures,
        log:
            f"logs/{name}.log",
        group:
            REPORT_GROUP
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("table_of_rows"),
            table=name,
        script:
            "../scripts/table_of_rows.py"
