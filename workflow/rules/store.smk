# Results from the stored light field, if the configuration stores it.
if STORE:
    # The page shows a few hundred views: decoding more would be useless.
    VIEWED = max((n for n in VIEWS if n <= 64), default=VIEWS[0])

    rule viewer:
        input:
            light_field=expand(f"{SLAB}/lightfield.mkv", n=VIEWED, allow_missing=True)[0],
        output:
            "results/tables/viewer/{scene}.html",
        log:
            "logs/viewer/{scene}.log",
        group:
            grouped("figures")
        conda:
            "../envs/lfcore.yaml"
        params:
            version=version("viewer"),
            device=DEVICE,
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
        priority: FIRST
        group:
            grouped("join_N{n}")
        conda:
            "../envs/lfcore.yaml"
        resources:
            mem_mb=sums_mib,
        params:
            **of_settings("planes", "picture_format", "device"),
            version=version("retrieve"),
        script:
            "../scripts/retrieve.py"
