# Data sets: batches of scenes -> shards -> a folder of items with its card and page.


if DATASET:

    rule dataset_batch:
        input:
            dataset_sources,
        output:
            shard=temp(f"{DATASET_FOLDER}/batches/{{batch}}.tar"),
            records=temp(f"{DATASET_FOLDER}/batches/{{batch}}.json"),
        log:
            f"logs/datasets/{DATASET_FOLDER.rpartition('/')[2]}/{{batch}}.log",
        wildcard_constraints:
            batch=r"\d{5}",
        conda:
            "../envs/lfcore.yaml"
        resources:
            runtime=lambda wildcards, attempt: 15 * attempt,
            mem_mb=3000,
        params:
            description=DATASET,
            scenes=dataset_scenes,
            device=DEVICE,
            version=version("dataset"),
        script:
            "../scripts/dataset_batch.py"

    rule dataset:
        input:
            shards=dataset_files("tar"),
            records=dataset_files("json"),
        output:
            data=directory(f"{DATASET_FOLDER}/data"),
            tables=multiext(
                f"{DATASET_FOLDER}/",
                "items.csv",
                "seconds.csv",
                "refused.csv",
                "sources.csv",
                "files.csv",
            ),
            description=f"{DATASET_FOLDER}/description.yaml",
            card=f"{DATASET_FOLDER}/croissant.json",
            page=f"{DATASET_FOLDER}/index.html",
        log:
            f"logs/datasets/{DATASET_FOLDER.rpartition('/')[2]}.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            description=DATASET,
            version=version("report"),
        script:
            "../scripts/dataset.py"

    for spelling in (DATASET_FOLDER, f"{DATASET_FOLDER}/"):

        rule:
            name:
                spelling
            input:
                rules.dataset.output,
            localrule: True
