# Three reports on the program itself: error against run time, stiff cases, what scenes leave out.
ANALYSIS = config["analysis"]


rule work_precision_scene:
    input:
        **of_scene("{scene}"),
    output:
        "results/{scene}/analysis/work_precision.json",
    log:
        "logs/work_precision/{scene}.log",
    # As tracing: long jobs first, so that the cores finish together.
    priority: 10
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        study=ANALYSIS["work_precision"],
        device=DEVICE,
    script:
        "../scripts/work_precision_scene.py"


rule work_precision:
    input:
        of_scenes("analysis/work_precision.json"),
    output:
        csv=table("work_precision"),
        convergence="results/tables/convergence.csv",
        figures=expand(
            "results/tables/figures/work_precision_{panel}.png",
            panel=PANELS["work_precision"],
        ),
    log:
        "logs/work_precision.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        panels=PANELS["work_precision"],
    script:
        "../scripts/work_precision.py"


rule recommendation:
    input:
        "results/tables/work_precision.csv",
    output:
        table("recommendation"),
    log:
        "logs/recommendation.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        targets_db=ANALYSIS["targets_db"],
    script:
        "../scripts/recommendation.py"


rule stability:
    output:
        csv=table("stability"),
        cases="results/tables/stability_cases.csv",
        heat_map="results/tables/figures/stability_heat_map.png",
        error_growth="results/tables/figures/stability_error_growth.png",
    log:
        "logs/stability.log",
    # One long job: it starts first, beside the tracing.
    priority: 20
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        rays=ANALYSIS["stability_rays"],
        cases=ANALYSIS["stability_cases"],
        device=DEVICE,
    script:
        "../scripts/stability.py"


rule left_out_scene:
    input:
        **of_scene("{scene}"),
    output:
        "results/{scene}/analysis/left_out.json",
    log:
        "logs/left_out/{scene}.log",
    priority: 5
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        measured=ANALYSIS["left_out"],
        device=DEVICE,
    script:
        "../scripts/left_out_scene.py"
