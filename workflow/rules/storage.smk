# Four reports on the store: its layouts, rate against distortion, ways to one picture, reading it.
STORAGE = SETTINGS["storage"]
STORAGE_TITLES = {
    "storage_layouts": "Layouts of the stored light field",
    "rate_distortion": "Rate against distortion",
    "equivalence": "One picture made in four ways",
    "retrieval": "What it costs to read a stored light field",
}
# What is not stored cannot be read.
STORAGE_REPORTS = [
    name for name in STORAGE_TITLES if name in STORAGE["make"] and (STORE or name != "retrieval")
]
OF_SCENES = {scene: f"results/tables/figures/{{name}}_{scene}.png" for scene in SCENES}
ONE_FIGURE = {"": "results/tables/figures/{name}.png"}
for name in STORAGE_REPORTS:
    figures = OF_SCENES if name in ("rate_distortion", "equivalence") else ONE_FIGURE
    SECTIONS[name] = {
        "title": STORAGE_TITLES[name],
        "table": f"results/tables/{name}.csv",
        "figures": {label: file.format(name=name) for label, file in figures.items()},
    }
    if name == "rate_distortion":
        SECTIONS["bd_rate"] = {
            "title": "Bits at equal quality (BD-rate)",
            "table": "results/tables/bd_rate.csv",
        }


rule storage_layouts_scene:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        "results/{scene}/storage/storage_layouts.json",
    log:
        "logs/storage_layouts/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sources=sources("storage_layouts_scene.py"),
        study=STORAGE["storage_layouts"],
        spatial_resolution=SETTINGS["spatial_resolution"],
        device=SETTINGS["device"],
    script:
        "../scripts/storage_layouts_scene.py"


rule rate_distortion_scene:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        "results/{scene}/storage/rate_distortion.json",
    log:
        "logs/rate_distortion/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sources=sources("rate_distortion_scene.py"),
        study=STORAGE["rate_distortion"],
        spatial_resolution=SETTINGS["spatial_resolution"],
        device=SETTINGS["device"],
    script:
        "../scripts/rate_distortion_scene.py"


rule equivalence_scene:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        rows="results/{scene}/storage/equivalence.json",
        figure=report(
            "results/tables/figures/equivalence_{scene}.png",
            caption="../report/equivalence.rst",
            category="Figures",
            labels={"figure": "equivalence", "scene": "{scene}"},
        ),
    log:
        "logs/equivalence/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    resources:
        mem_mb=2000,
    params:
        sources=sources("equivalence_scene.py"),
        study=STORAGE["equivalence"],
        device=SETTINGS["device"],
    script:
        "../scripts/equivalence_scene.py"


if STORE:

    rule retrieval_scene:
        input:
            scene="results/{scene}/scene.npz",
            light_fields=of_resolutions("lightfield.mkv"),
        output:
            "results/{scene}/storage/retrieval.json",
        log:
            "logs/retrieval/{scene}.log",
        conda:
            "../envs/lfcore.yaml"
        threads: 1
        resources:
            mem_mb=2000,
        params:
            sources=sources("retrieval_scene.py"),
            study=STORAGE["retrieval"],
            device=SETTINGS["device"],
        script:
            "../scripts/retrieval_scene.py"


rule storage_layouts:
    input:
        rows=of_scenes("storage/storage_layouts.json"),
        caption=caption_of("storage_layouts"),
    output:
        csv=report(
            "results/tables/storage_layouts.csv",
            caption="../report/storage_layouts.rst",
            category="Tables",
        ),
        markdown="results/tables/storage_layouts.md",
        figure="results/tables/figures/storage_layouts.png",
    log:
        "logs/storage_layouts.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("storage_table.py"),
        table="storage_layouts",
        title=STORAGE_TITLES["storage_layouts"],
        config=SETTINGS,
    script:
        "../scripts/storage_table.py"


rule equivalence:
    input:
        rows=of_scenes("storage/equivalence.json"),
        caption=caption_of("equivalence"),
    output:
        csv=report(
            "results/tables/equivalence.csv",
            caption="../report/equivalence.rst",
            category="Tables",
        ),
        markdown="results/tables/equivalence.md",
    log:
        "logs/equivalence.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("storage_table.py"),
        table="equivalence",
        title=STORAGE_TITLES["equivalence"],
        config=SETTINGS,
    script:
        "../scripts/storage_table.py"


rule retrieval:
    input:
        rows=of_scenes("storage/retrieval.json"),
        caption=caption_of("retrieval"),
    output:
        csv=report(
            "results/tables/retrieval.csv",
            caption="../report/retrieval.rst",
            category="Tables",
        ),
        markdown="results/tables/retrieval.md",
        figure="results/tables/figures/retrieval.png",
    log:
        "logs/retrieval.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("storage_table.py"),
        table="retrieval",
        title=STORAGE_TITLES["retrieval"],
        config=SETTINGS,
    script:
        "../scripts/storage_table.py"


rule rate_distortion:
    input:
        rows=of_scenes("storage/rate_distortion.json"),
        captions=[caption_of(name) for name in ["rate_distortion", "bd_rate"]],
    output:
        csv=[
            report(
                f"results/tables/{name}.csv",
                caption=f"../report/{name}.rst",
                category="Tables",
            )
            for name in ["rate_distortion", "bd_rate"]
        ],
        markdown=["results/tables/rate_distortion.md", "results/tables/bd_rate.md"],
        figures=expand("results/tables/figures/rate_distortion_{scene}.png", scene=SCENES),
    log:
        "logs/rate_distortion.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("rate_distortion.py"),
        titles=["Rate against distortion", "Bits at equal quality"],
        scenes=list(SCENES),
        config=SETTINGS,
    script:
        "../scripts/rate_distortion.py"
