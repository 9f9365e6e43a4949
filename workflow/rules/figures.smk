# Pictures of the thesis: focal stack (4.2), aperture stack (4.3, 4.4), corner views (6.3), the
# plenoptic photograph (4.6), and other renderers beside ours (4.5). Stacks are sliced by depth.
import importlib.util
import shutil

STACKS = ["focal_stack", "aperture_stack", "sub_aperture_views"]
# Stacks by file; the figure of recipes has the focal stack beside the thesis's and the true one.
TRACED_STACKS = {
    name: f"results/{{scene}}/figures/{name}.npz"
    for name in STACKS
    if name in REPORTS or (name == "focal_stack" and "recipes" in REPORTS)
}
RECIPES = {
    "thesis": TRACED["on_the_fly"][-1],
    "truth": "results/{scene}/analysis/truth_wide.npz",
}
WANTED_SHEETS = [name for name in [*STACKS, "recipes"] if name in REPORTS]

if TRACED_STACKS:

    rule trace_stacks:
        input:
            **of_scene("{scene}"),
        output:
            **TRACED_STACKS,
        log:
            "logs/trace_stacks/{scene}.log",
        priority: FIRST
        group:
            grouped("figures")
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("trace_stacks"),
            pixels=PIXELS,
            planes=config["planes"],
            views=SETTINGS["sub_aperture_views"]["views"],
            stops=SETTINGS["aperture_stack"]["stops"],
            device=DEVICE,
        script:
            "../scripts/trace_stacks.py"

    rule contact_sheets:
        input:
            **TRACED_STACKS,
            **(RECIPES if "recipes" in REPORTS else {}),
        output:
            **{name: figure(name, f"{name}_{{scene}}", "{scene}") for name in WANTED_SHEETS},
        log:
            "logs/contact_sheets/{scene}.log",
        priority: FIRST
        group:
            grouped("figures")
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("contact_sheets"),
            views=VIEWS[-1],
        script:
            "../scripts/contact_sheets.py"


rule plenoptic_photograph:
    input:
        **of_scene(CHART),
    output:
        photographs=[
            f"results/{CHART}/figures/photograph_in_focus.png",
            f"results/{CHART}/figures/photograph_out_of_focus.png",
        ],
        sheet=figure("plenoptic_photograph", "plenoptic_photograph", CHART),
    log:
        "logs/plenoptic_photograph.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("plenoptic_photograph"),
        camera=SETTINGS["plenoptic_photograph"],
        device=DEVICE,
    script:
        "../scripts/plenoptic_photograph.py"


rule other_renderers:
    input:
        **of_scene(CHART),
    output:
        csv=table("other_renderers"),
        figure="results/tables/figures/other_renderers.png",
    log:
        "logs/other_renderers.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("other_renderers"),
        # Installing a renderer makes the figure anew.
        installed=[bool(shutil.which("povray")), bool(importlib.util.find_spec("mitsuba"))],
        study=SETTINGS["other_renderers"],
        device=DEVICE,
    script:
        "../scripts/other_renderers.py"
