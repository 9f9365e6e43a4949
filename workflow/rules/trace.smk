# Algorithms 1 and 3: rays of a batch of tiles -> their part of the sensor planes and, where stored,
# a video segment a tile.
TRACED = {
    "planes": temp(f"{SLAB}/tiles/{{batch}}.planes.npz"),
    "seconds": f"{SLAB}/tiles/{{batch}}.json",
}
if STORE:
    TRACED["segments"] = temp(f"{SLAB}/tiles/{{batch}}.segments")


rule trace:
    input:
        scene="results/{scene}/scene.npz",
        bvh="results/{scene}/bvh.npz",
    output:
        **TRACED,
    log:
        "logs/trace/{scene}/N{n}/{batch}.log",
    # Long jobs first, so that the cores finish together.
    priority: 10
    conda:
        "../envs/lfcore.yaml"
    threads: 1
    params:
        sources=digest(*sources.STORING, "evaluation/timing.py"),
        spatial_resolution=SETTINGS["spatial_resolution"],
        planes=SETTINGS["planes"],
        layout=SETTINGS["layout"],
        tile_mib=SETTINGS["tile_mib"],
        batch=lambda wildcards: list(BATCHES[int(wildcards.n)][wildcards.batch]),
        encoder=SETTINGS["encoder"],
        device=SETTINGS["device"],
        store=STORE,
    script:
        "../scripts/trace.py"


rule sum_planes:
    input:
        scene="results/{scene}/scene.npz",
        planes=of_batches(".planes.npz"),
        seconds=of_batches(".json"),
    output:
        stack=f"{SLAB}/planes/on_the_fly.npz",
        pictures=directory(f"{SLAB}/planes/on_the_fly"),
        seconds=f"{SLAB}/trace.json",
    log:
        "logs/sum_planes/{scene}/N{n}.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=digest(*sources.SCENE, "storage"),
        spatial_resolution=SETTINGS["spatial_resolution"],
        planes=SETTINGS["planes"],
        picture_format=SETTINGS["picture_format"],
    script:
        "../scripts/sum_planes.py"
