# The light field as one file, and pictures from it: only where the configuration stores it.
if STORE:

    rule join:
        input:
            scene="results/{scene}/scene.npz",
            segments=of_batches(".segments"),
            seconds=of_batches(".json"),
        output:
            light_field=f"{SLAB}/lightfield.mkv",
            seconds=f"{SLAB}/store.json",
        log:
            "logs/join/{scene}/N{n}.log",
        group:
            grouped("join_N{n}")
        conda:
            "../envs/lfcore.yaml"
        params:
            sources=digest(*sources.SCENE, "storage", "evaluation/timing.py"),
            spatial_resolution=SETTINGS["spatial_resolution"],
            layout=SETTINGS["layout"],
            tile_mib=SETTINGS["tile_mib"],
            encoder=SETTINGS["encoder"],
        script:
            "../scripts/join.py"

    rule viewer:
        input:
            light_field=of_resolutions("lightfield.mkv")[-1],
        output:
            "results/tables/viewer/{scene}.html",
        log:
            "logs/viewer/{scene}.log",
        group:
            grouped("figures")
        conda:
            "../envs/lfcore.yaml"
        params:
            sources=digest(*sources.READING, "viewer"),
            device=SETTINGS["device"],
        script:
            "../scripts/viewer.py"

    rule retrieve:
        input:
            scene="results/{scene}/scene.npz",
            light_field=f"{SLAB}/lightfield.mkv",
        output:
            stack=f"{SLAB}/planes/from_video.npz",
            pictures=directory(f"{SLAB}/planes/from_video"),
            seconds=f"{SLAB}/retrieve.json",
        log:
            "logs/retrieve/{scene}/N{n}.log",
        group:
            grouped("join_N{n}")
        conda:
            "../envs/lfcore.yaml"
        threads: 2
        resources:
            mem_mb=lambda wildcards, attempt: costs.sums_mib(
                SETTINGS["spatial_resolution"], attempt
            ),
        params:
            sources=digest(*sources.READING),
            planes=SETTINGS["planes"],
            picture_format=SETTINGS["picture_format"],
            device=SETTINGS["device"],
        script:
            "../scripts/retrieve.py"
