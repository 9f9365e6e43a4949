# Three reports on the program itself: error against run time, stiff cases, what scenes leave out.
ANALYSIS = SETTINGS["analysis"]
ANALYSES = {
    "work_precision": {
        "title": "Error against run time",
        "figures": ["quadrature", "convergence", "methods", "arithmetic", "storage"],
    },
    "recommendation": {"title": "Recommended settings", "figures": []},
    "stability": {"title": "Stiff and extreme cases", "figures": ["heat_map", "error_growth"]},
    "left_out": {"title": "Nothing a scene does not need", "figures": []},
}
for name, about in ANALYSES.items():
    if name in ANALYSIS["make"]:
        SECTIONS[name] = {"title": about["title"], "table": f"results/tables/{name}.csv"}
        if about["figures"]:
            SECTIONS[name]["figures"] = {
                figure.replace("_", " "): f"results/tables/figures/{name}_{figure}.png"
                for figure in about["figures"]
            }


rule work_precision_scene:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        "results/{scene}/analysis/work_precision.json",
    log:
        "logs/work_precision/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sources=sources("work_precision_scene.py"),
        study=ANALYSIS["work_precision"],
        device=SETTINGS["device"],
    script:
        "../scripts/work_precision_scene.py"


rule work_precision:
    input:
        rows=expand("results/{scene}/analysis/work_precision.json", scene=SCENES),
        caption=caption_of("work_precision"),
    output:
        csv=report(
            "results/tables/work_precision.csv",
            caption="../report/work_precision.rst",
            category="Tables",
        ),
        markdown="results/tables/work_precision.md",
        convergence="results/tables/convergence.csv",
        figures=expand(
            "results/tables/figures/work_precision_{panel}.png",
            panel=ANALYSES["work_precision"]["figures"],
        ),
    log:
        "logs/work_precision.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("work_precision.py"),
        config=SETTINGS,
        panels=ANALYSES["work_precision"]["figures"],
    script:
        "../scripts/work_precision.py"


rule recommendation:
    input:
        points="results/tables/work_precision.csv",
        caption=caption_of("recommendation"),
    output:
        csv=report(
            "results/tables/recommendation.csv",
            caption="../report/recommendation.rst",
            category="Tables",
        ),
        markdown="results/tables/recommendation.md",
    log:
        "logs/recommendation.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("recommendation.py"),
        targets_db=ANALYSIS["targets_db"],
        config=SETTINGS,
    script:
        "../scripts/recommendation.py"


rule stability:
    input:
        caption=caption_of("stability"),
    output:
        csv=report(
            "results/tables/stability.csv",
            caption="../report/stability.rst",
            category="Tables",
        ),
        cases="results/tables/stability_cases.csv",
        markdown="results/tables/stability.md",
        heat_map="results/tables/figures/stability_heat_map.png",
        error_growth="results/tables/figures/stability_error_growth.png",
    log:
        "logs/stability.log",
    # One long job: it starts first, beside the tracing.
    priority: 20
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sources=sources("stability.py"),
        rays=ANALYSIS["stability_rays"],
        device=SETTINGS["device"],
        config=SETTINGS,
    script:
        "../scripts/stability.py"


rule left_out_scene:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        "results/{scene}/analysis/left_out.json",
    log:
        "logs/left_out/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sources=sources("left_out_scene.py"),
        measured=ANALYSIS["left_out"],
        device=SETTINGS["device"],
    script:
        "../scripts/left_out_scene.py"


rule left_out:
    input:
        rows=expand("results/{scene}/analysis/left_out.json", scene=SCENES),
        caption=caption_of("left_out"),
    output:
        csv=report(
            "results/tables/left_out.csv",
            caption="../report/left_out.rst",
            category="Tables",
        ),
        markdown="results/tables/left_out.md",
    log:
        "logs/left_out.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("left_out.py"),
        config=SETTINGS,
    script:
        "../scripts/left_out.py"
