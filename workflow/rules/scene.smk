# What is looked at: scene description -> arrays in camera space -> hierarchy.


rule parse:
    input:
        scene_inputs,
    output:
        "results/{scene}/scene.npz",
    log:
        "logs/parse/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=lambda wildcards: SCENE_SOURCES[wildcards.scene],
    script:
        "../scripts/parse.py"


rule build:
    input:
        scene="results/{scene}/scene.npz",
    output:
        "results/{scene}/bvh.npz",
    log:
        "logs/build/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=2000,
    params:
        sources=sources("build.py"),
    script:
        "../scripts/build.py"
