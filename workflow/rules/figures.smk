# Pictures of the thesis: focal stack (4.2), aperture stack (4.3, 4.4), corner views (6.3), and
# quality over N.
SHEETS = {
    "focal_stack": "Focal stack",
    "aperture_stack": "Aperture stack",
    "sub_aperture_views": "Sub-aperture views",
}
# The focal stack is there already: the planes of the largest N.
STACKS = {
    "focal_stack": f"results/{{scene}}/N{RESOLUTIONS[-1]}/planes/on_the_fly.npz",
    "aperture_stack": "results/{scene}/figures/aperture_stack.npz",
    "sub_aperture_views": "results/{scene}/figures/sub_aperture_views.npz",
}
for figure, title in SHEETS.items():
    if wanted(figure):
        SECTIONS[figure] = {
            "title": title,
            "figures": {scene: f"results/tables/figures/{figure}_{scene}.png" for scene in SCENES},
        }


rule trace_aperture_stack:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        STACKS["aperture_stack"],
    log:
        "logs/trace_aperture_stack/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("trace_aperture_stack.py"),
        spatial_resolution=SETTINGS["spatial_resolution"],
        angular_resolution=SETTINGS["figures"]["angular_resolution"],
        stops=SETTINGS["figures"]["aperture_stops"],
        device=SETTINGS["device"],
    script:
        "../scripts/trace_aperture_stack.py"


rule trace_views:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        STACKS["sub_aperture_views"],
    log:
        "logs/trace_views/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("trace_views.py"),
        spatial_resolution=SETTINGS["spatial_resolution"],
        angular_resolution=SETTINGS["figures"]["angular_resolution"],
        device=SETTINGS["device"],
    script:
        "../scripts/trace_views.py"


rule contact_sheet:
    input:
        lambda wildcards: STACKS[wildcards.figure].format(scene=wildcards.scene),
    output:
        report(
            "results/tables/figures/{figure}_{scene}.png",
            caption="../report/contact_sheet.rst",
            category="Figures",
            labels={"figure": "{figure}", "scene": "{scene}"},
        ),
    log:
        "logs/contact_sheet/{figure}_{scene}.log",
    wildcard_constraints:
        figure="|".join(SHEETS),
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("contact_sheet.py"),
    script:
        "../scripts/contact_sheet.py"


rule curves:
    input:
        "results/tables/{table}.csv",
    output:
        "results/tables/figures/{table}_curves.png",
    log:
        "logs/curves/{table}.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("curves.py"),
    script:
        "../scripts/curves.py"
