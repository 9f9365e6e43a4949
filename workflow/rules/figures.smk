# Pictures of the thesis: focal stack (4.2), aperture stack (4.3, 4.4), corner views (6.3), the
# plenoptic photograph (4.6), other ray tracers beside ours (4.5), and quality over N.
import importlib.util
import shutil

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

if wanted("plenoptic_photograph"):
    SECTIONS["plenoptic_photograph"] = {
        "title": "Photographs of a plenoptic camera",
        "figures": {"": "results/tables/figures/plenoptic_photograph.png"},
    }
if wanted("other_renderers"):
    SECTIONS["other_renderers"] = {
        "title": "Other ray tracers",
        "table": "results/tables/other_renderers.csv",
        "figures": {"": "results/tables/figures/other_renderers.png"},
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


rule plenoptic_photograph:
    input:
        scene=f"results/{CHART}/scene.npz",
        bvh=f"results/{CHART}/bvh.npz",
    output:
        photographs=[
            f"results/{CHART}/figures/photograph_in_focus.png",
            f"results/{CHART}/figures/photograph_out_of_focus.png",
        ],
        sheet=report(
            "results/tables/figures/plenoptic_photograph.png",
            caption="../report/plenoptic_photograph.rst",
            category="Figures",
            labels={"figure": "plenoptic_photograph", "scene": CHART},
        ),
    log:
        "logs/plenoptic_photograph.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("plenoptic_photograph.py"),
        camera=SETTINGS["figures"]["plenoptic"],
        device=SETTINGS["device"],
    script:
        "../scripts/plenoptic_photograph.py"


rule other_renderers:
    input:
        scene=f"results/{CHART}/scene.npz",
        bvh=f"results/{CHART}/bvh.npz",
        caption=caption_of("other_renderers"),
    output:
        csv=report(
            "results/tables/other_renderers.csv",
            caption="../report/other_renderers.rst",
            category="Tables",
        ),
        markdown="results/tables/other_renderers.md",
        figure="results/tables/figures/other_renderers.png",
    log:
        "logs/other_renderers.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("other_renderers.py"),
        # Installing a renderer makes the figure anew.
        installed=[bool(shutil.which("povray")), bool(importlib.util.find_spec("mitsuba"))],
        study=SETTINGS["figures"]["renderers"],
        title="Other ray tracers",
        device=SETTINGS["device"],
        config=SETTINGS,
    script:
        "../scripts/other_renderers.py"
