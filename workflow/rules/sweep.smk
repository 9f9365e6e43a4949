# A sweep: all its cases in one graph, joined in one table and one figure.
#   snakemake --cores 2 --config sweep=config/sweeps/crf.tsv -- sweep
if PLAN and PLAN.sweep:
    SWEPT = f"results/sweeps/{Path(config['sweep']).stem}"
    POINT = "group~{group}/scene~{scene}/n~{n}"

    rule sweep_group:
        input:
            **of_scene("{scene}"),
        output:
            # Rows of unchanged cases are kept.
            update(f"{SWEPT}/{POINT}.json"),
        log:
            f"logs/{SWEPT}/{POINT}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("sweep_group"),
            study=lambda wildcards: PLAN.sweep.study(
                wildcards.group, wildcards.scene, int(wildcards.n)
            ),
            device=DEVICE,
        script:
            "../scripts/sweep_group.py"

    rule sweep:
        input:
            sweep_files(f"{SWEPT}/{POINT}.json"),
        output:
            csv=f"{SWEPT}/table.csv",
            figure=f"{SWEPT}/figure.png",
        log:
            f"logs/{SWEPT}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("sweep_table"),
            overrides=lambda wildcards: PLAN.sweep.overrides,
        script:
            "../scripts/sweep_table.py"
