# Reports on storage: layouts, rate against distortion, equivalence of methods, reading.


for name in ("storage_layouts", "rate_distortion"):

    rule:
        name:
            f"{name}_scene"
        input:
            **of_scene("{scene}"),
        output:
            f"results/{{scene}}/storage/{name}.json",
        log:
            f"logs/{name}/{{scene}}.log",
        priority: LONG
        conda:
            "../envs/lfcore.yaml"
        params:
            **of_settings("pixels", "device"),
            version=version("storage_samples"),
            report=name,
            study=SETTINGS[name],
        script:
            "../scripts/storage_samples.py"


rule equivalence_scene:
    input:
        **of_scene("{scene}"),
    output:
        rows="results/{scene}/storage/equivalence.json",
        figure=figure("equivalence", "equivalence_{scene}", "{scene}"),
    log:
        "logs/equivalence/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("equivalence_scene"),
        study=SETTINGS["equivalence"],
        device=DEVICE,
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
        params:
            version=version("retrieval_scene"),
            study=SETTINGS["retrieval"],
            device=DEVICE,
        script:
            "../scripts/retrieval_scene.py"


rule rate_distortion:
    input:
        of_scenes("storage/rate_distortion.json"),
    output:
        rate_distortion=table("rate_distortion"),
        bd_rate=table("bd_rate"),
        figures=expand("results/tables/figures/rate_distortion_{scene}.png", scene=SCENES),
    log:
        "logs/rate_distortion.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("rate_distortion"),
        scenes=list(SCENES),
    script:
        "../scripts/rate_distortion.py"
