# Pictures against the true one: averaged over pixel and lens.
TRUE_PICTURE = ANALYSIS["true_picture"]
TRUTHS = {
    "wide": "results/{scene}/analysis/truth_wide.npz",
    "stopped": "results/{scene}/analysis/truth_stopped.npz",
}


# Made once a scene and kept: whatever is judged, the truth stays.
rule truth:
    input:
        **of_scene("{scene}"),
    output:
        "results/{scene}/analysis/truth_{lens}.npz",
    log:
        "logs/truth/{scene}/{lens}.log",
    wildcard_constraints:
        lens="|".join(TRUTHS),
    priority: 10
    group:
        grouped("figures")
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        counts=TRUE_PICTURE["truth"],
        stops=lambda wildcards: TRUE_PICTURE["stops"] if wildcards.lens == "stopped" else 0,
        planes=config["planes"],
        pixels=PIXELS,
        device=DEVICE,
    script:
        "../scripts/truth.py"


rule true_picture_scene:
    input:
        **TRUTHS,
        **of_scene("{scene}"),
        on_the_fly=of_resolutions("planes/on_the_fly.npz"),
        trace=of_resolutions("trace.json"),
    output:
        "results/{scene}/analysis/true_picture.json",
    log:
        "logs/true_picture/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
        study=TRUE_PICTURE,
        views=VIEWS,
        device=DEVICE,
    script:
        "../scripts/true_picture_scene.py"


rule true_picture:
    input:
        of_scenes("analysis/true_picture.json"),
    output:
        csv=table("true_picture"),
        figure="results/tables/figures/true_picture_run_time.png",
    log:
        "logs/true_picture.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("report"),
    script:
        "../scripts/true_picture.py"


# What true pictures recommend, recorded beside the thesis's largest N.
if STORE:

    rule our_choice_scene:
        input:
            **of_scene("{scene}"),
            wide=TRUTHS["wide"],
            true_picture="results/{scene}/analysis/true_picture.json",
            trace=of_resolutions("trace.json")[-1],
            store=of_resolutions("store.json")[-1],
            retrieve=of_resolutions("retrieve.json")[-1],
            from_video=of_resolutions("planes/from_video.npz")[-1],
        output:
            rows="results/{scene}/analysis/our_choice.json",
            light_field="results/{scene}/analysis/our_choice.mkv",
        log:
            "logs/our_choice/{scene}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("report"),
            views=VIEWS[-1],
            device=DEVICE,
        script:
            "../scripts/our_choice_scene.py"

    rule our_choice:
        input:
            of_scenes("analysis/our_choice.json"),
        output:
            csv=table("our_choice"),
        log:
            "logs/our_choice.log",
        group:
            REPORT_GROUP
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("report"),
        script:
            "../scripts/our_choice.py"
