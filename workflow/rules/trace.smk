# Algorithms 1 and 3: rays of a batch of tiles -> their part of the sensor planes and, if stored, one
# video segment per tile.
STORED_AS = ("layout", "tile_mib", "encoding")
BATCH = {
    "planes": temp(f"{SLAB}/tiles/{{batch}}.planes.npz"),
    "seconds": f"{SLAB}/tiles/{{batch}}.json",
}
if STORE:
    BATCH["segments"] = temp(f"{SLAB}/tiles/{{batch}}.segments")


rule trace:
    input:
        **of_scene("{scene}"),
    output:
        **BATCH,
    log:
        "logs/trace/{scene}/N{n}/{batch}.log",
    priority: FIRST
    group:
        TRACE_GROUP
    conda:
        "../envs/lfcore.yaml"
    resources:
        runtime=trace_minutes,
        mem_mb=trace_mib,
    params:
        **of_settings("pixels", "planes", *STORED_AS, "device", "store"),
        version=version("trace"),
        batch=lambda wildcards: [batch_of(wildcards).start, batch_of(wildcards).stop],
    script:
        "../scripts/trace.py"


# The results of all batches of a light field: pictures and, if it is stored, one file.
JOINED = {
    "stack": f"{SLAB}/planes/on_the_fly.npz",
    "pictures": directory(f"{SLAB}/planes/on_the_fly"),
    "trace": f"{SLAB}/trace.json",
}
BATCHES = {"planes": of_batches(".planes.npz"), "seconds": of_batches(".json")}
if STORE:
    JOINED |= {"light_field": f"{SLAB}/lightfield.mkv", "store": f"{SLAB}/store.json"}
    BATCHES["segments"] = of_batches(".segments")


rule join:
    input:
        **BATCHES,
        scene="results/{scene}/scene.npz",
    output:
        **JOINED,
    log:
        "logs/join/{scene}/N{n}.log",
    priority: FIRST
    group:
        grouped("join_N{n}")
    conda:
        "../envs/lfcore.yaml"
    resources:
        mem_mb=sums_mib,
    params:
        **of_settings("pixels", "planes", "picture_format", *STORED_AS),
        version=version("join"),
    script:
        "../scripts/join.py"
