# Errors of pictures: metrics per scene, then the tables over all scenes and their curves over N.


rule evaluate:
    input:
        **TRACED,
        **STORED,
        truth="results/{scene}/analysis/truth_wide.npz",
    output:
        "results/{scene}/evaluation.json",
    log:
        "logs/evaluate/{scene}.log",
    priority: FIRST
    group:
        grouped("figures")
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("evaluate"),
        views=VIEWS,
        pixels=PIXELS,
    script:
        "../scripts/evaluate.py"


rule thesis_tables:
    input:
        of_scenes("evaluation.json"),
    output:
        csv=[table(name) for name in THESIS_TABLES],
        curves=[
            f"results/tables/figures/{name}_curves.png"
            for name in THESIS_TABLES
            if "quality" in REPORTS
        ],
    log:
        "logs/thesis_tables.log",
    priority: FIRST
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("tables"),
        tables=THESIS_TABLES,
    script:
        "../scripts/tables.py"
