# Pictures against the true one: averaged over pixel and lens.
TRUE_PICTURE = ANALYSIS["true_picture"]
TRUTHS = {
    "wide": "results/{scene}/analysis/truth_wide.npz",
    "stopped": "results/{scene}/analysis/truth_stopped.npz",
}


# Made once a scene and kept: whatever is judged, the truth stays.
rule truth:
    input:
        **of_scene("{scene}"),
    output:
        "results/{scene}/analysis/truth_{lens}.npz",
    log:
        "logs/truth/{scene}/{lens}.log",
    wildcard_constraints:
        lens="|".join(TRUTHS),
    group:
        grouped("figures")
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=digest(*sources.READING, *sources.MEASURING, "evaluation/true_picture/reference.py"),
        counts=TRUE_PICTURE["truth"],
        stops=lambda wildcards: TRUE_PICTURE["stops"] if wildcards.lens == "stopped" else 0,
        planes=SETTINGS["planes"],
        pixels=SETTINGS["spatial_resolution"],
        device=SETTINGS["device"],
    script:
        "../scripts/truth.py"


rule true_picture_scene:
    input:
        **TRUTHS,
        **of_scene("{scene}"),
        on_the_fly=of_resolutions("planes/on_the_fly.npz"),
        trace=of_resolutions("trace.json"),
    output:
        "results/{scene}/analysis/true_picture.json",
    log:
        "logs/true_picture/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=digest(*sources.READING, *sources.MEASURING, "evaluation/true_picture"),
        study=TRUE_PICTURE,
        angular_resolutions=RESOLUTIONS,
        device=SETTINGS["device"],
    script:
        "../scripts/true_picture_scene.py"


rule true_picture:
    input:
        of_scenes("analysis/true_picture.json"),
    output:
        csv=table("true_picture"),
        figure="results/tables/figures/true_picture_run_time.png",
    log:
        "logs/true_picture.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=digest(
            *sources.READING,
            *sources.TABLES,
            "evaluation/true_picture",
            "evaluation/work_precision",
        ),
    script:
        "../scripts/true_picture.py"
