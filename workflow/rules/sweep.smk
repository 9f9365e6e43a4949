# A sweep: all its cases in one graph, joined in one table and a figure.
#   make sweep SWEEP=config/sweeps/crf.tsv
if SWEEP:
    from snakemake.utils import Paramspace

    SPACE = Paramspace(SWEEP.points)
    SWEPT = f"results/sweeps/{SWEEP.name}"

    rule sweep_group:
        input:
            **of_scene("{scene}"),
        output:
            f"{SWEPT}/{SPACE.wildcard_pattern}.json",
        log:
            f"logs/sweeps/{SWEEP.name}/{SPACE.wildcard_pattern}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            sources=digest(*sources.READING, *sources.MEASURING, "evaluation/sweep.py"),
            study=lambda wildcards: SWEEP.study(wildcards.group, wildcards.scene, int(wildcards.n)),
            device=SETTINGS["device"],
        script:
            "../scripts/sweep_group.py"

    rule sweep:
        input:
            expand(f"{SWEPT}/{{point}}.json", point=SPACE.instance_patterns),
        output:
            csv=f"{SWEPT}/table.csv",
            figure=f"{SWEPT}/figure.png",
        log:
            f"logs/sweeps/{SWEEP.name}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            sources=digest(
                *sources.READING,
                *sources.TABLES,
                "workflow/sweep.py",
                "workflow/settings.py",
                "workflow/key*.py",
            ),
            sweep=SWEEP,
        script:
            "../scripts/sweep_table.py"
