# Scenes: description -> arrays in camera space -> hierarchy -> baked light.


rule parse:
    input:
        scene_inputs,
    output:
        "results/{scene}/scene.npz",
    log:
        "logs/parse/{scene}.log",
    priority: FIRST
    group:
        grouped("prepare")
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("parse"),
    script:
        "../scripts/parse.py"


rule build:
    input:
        scene="results/{scene}/scene.npz",
    output:
        "results/{scene}/bvh.npz",
    log:
        "logs/build/{scene}.log",
    priority: FIRST
    group:
        grouped("prepare")
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("build"),
    script:
        "../scripts/build.py"


# Only for scenes with a sky or bounces.
rule bake:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        "results/{scene}/light.npz",
    log:
        "logs/bake/{scene}.log",
    priority: FIRST
    group:
        grouped("prepare")
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("bake"),
        device=DEVICE,
    script:
        "../scripts/bake.py"
