# Pictures against pictures: metrics of each scene, then the tables over all scenes.
MEASURED = {
    "scene": "results/{scene}/scene.npz",
    "on_the_fly": of_resolutions("planes/on_the_fly.npz"),
    "trace": of_resolutions("trace.json"),
}
TABLES = ["table_7_1"]
if STORE:
    MEASURED["from_video"] = of_resolutions("planes/from_video.npz")
    MEASURED["store"] = of_resolutions("store.json")
    MEASURED["retrieve"] = of_resolutions("retrieve.json")
    TABLES += ["table_7_2", "table_7_3"]


rule evaluate:
    input:
        **MEASURED,
    output:
        "results/{scene}/evaluation.json",
    log:
        "logs/evaluate/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("evaluate.py"),
        angular_resolutions=RESOLUTIONS,
        spatial_resolution=SETTINGS["spatial_resolution"],
    script:
        "../scripts/evaluate.py"


rule tables:
    input:
        records=expand("results/{scene}/evaluation.json", scene=SCENES),
        captions=[caption_of(table) for table in TABLES],
    output:
        csv=[
            report(
                f"results/tables/{table}.csv",
                caption=f"../report/{table}.rst",
                category="Tables",
            )
            for table in TABLES
        ],
        markdown=[f"results/tables/{table}.md" for table in TABLES],
    log:
        "logs/tables.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("tables.py"),
        tables=TABLES,
        config=SETTINGS,
    script:
        "../scripts/tables.py"
