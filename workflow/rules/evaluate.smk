# Pictures against pictures: metrics of each scene, then the tables over all scenes and their curves over N.
MEASURED = {
    "scene": "results/{scene}/scene.npz",
    "on_the_fly": of_resolutions("planes/on_the_fly.npz"),
    "trace": of_resolutions("trace.json"),
    "truth": "results/{scene}/analysis/truth_wide.npz",
}
if STORE:
    MEASURED["from_video"] = of_resolutions("planes/from_video.npz")
    MEASURED["store"] = of_resolutions("store.json")
    MEASURED["retrieve"] = of_resolutions("retrieve.json")


rule evaluate:
    input:
        **MEASURED,
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
        version=version("report"),
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
        version=version("report"),
        tables=THESIS_TABLES,
    script:
        "../scripts/tables.py"
