# Data sets: batches of scenes -> shards -> a folder of items with its card and page, which replaces
# an earlier run's folder when it is whole.
if PLAN and PLAN.dataset:
    SET = PLAN.dataset
    SET_FOLDER = f"results/datasets/{SET.name}"
    SET_LOG = f"logs/datasets/{SET.name}"
    BATCHES_OF_SET = SET.batches()

    rule dataset_sources:
        input:
            meshes=[local(str(file)) for file in SET.mesh_files()],
            textures=[local(str(file)) for file in SET.texture_files()],
        output:
            f"{SET_FOLDER}/batches/sources.json",
        log:
            f"{SET_LOG}/sources.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            description=SET.of_scenes(),
            version=version("dataset_sources"),
        script:
            "../scripts/dataset_sources.py"

    rule dataset_batch:
        input:
            f"{SET_FOLDER}/batches/sources.json",
        output:
            shard=temp(f"{SET_FOLDER}/batches/{{batch}}.tar"),
            records=temp(f"{SET_FOLDER}/batches/{{batch}}.json"),
        log:
            f"{SET_LOG}/{{batch}}.log",
        wildcard_constraints:
            batch=r"\d{5}",
        conda:
            "../envs/lfcore.yaml"
        resources:
            runtime=set_minutes,
            mem_mb=lambda wildcards, attempt: 3000 * attempt,
        params:
            description=SET.of_scenes(),
            scenes=lambda wildcards: [
                SET.scenes_of(wildcards.batch).start,
                SET.scenes_of(wildcards.batch).stop,
            ],
            device=DEVICE,
            version=version("dataset_batch"),
        script:
            "../scripts/dataset_batch.py"

    rule dataset_whole:
        input:
            shards=expand(rules.dataset_batch.output.shard, batch=BATCHES_OF_SET),
            records=expand(rules.dataset_batch.output.records, batch=BATCHES_OF_SET),
        output:
            temp(directory(f"{SET_FOLDER}/batches/whole")),
        log:
            f"{SET_LOG}/whole.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            description=SET.model_dump(),
            folder=SET_FOLDER,
            version=version("dataset"),
        script:
            "../scripts/dataset.py"

    rule dataset:
        input:
            rules.dataset_whole.output,
        output:
            data=directory(f"{SET_FOLDER}/data"),
            pictures=directory(f"{SET_FOLDER}/page"),
            tables=multiext(
                f"{SET_FOLDER}/",
                "items.csv",
                "seconds.csv",
                "refused.csv",
                "sources.csv",
                "files.csv",
            ),
            description=f"{SET_FOLDER}/description.yaml",
            card=f"{SET_FOLDER}/croissant.json",
            page=f"{SET_FOLDER}/index.html",
        log:
            f"{SET_LOG}/renamed.log",
        params:
            folder=lambda wildcards, output: Path(output.card).parent,
        shell:
            "mv {input}/* {params.folder}/ 2> {log}"

    for spelling in (SET_FOLDER, f"{SET_FOLDER}/"):

        rule:
            name:
                spelling
            input:
                rules.dataset.output,
            localrule: True
