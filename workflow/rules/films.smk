# Films of light fields: a few rays of all instants -> a job for each group of instants -> one file.
FILM = config["film"]
FILM_FOLDER = f"results/{{scene}}/M{PIXELS}/film"
OF_FILM = of_settings("film", "pixels", "encoding", "device")

if PLAN and FILM["frames"]:

    rule film_ahead:
        input:
            scene=scene_inputs,
            light=of_scene("{scene}")["light"],
        output:
            f"{FILM_FOLDER}/ahead.json",
        log:
            "logs/film/{scene}/ahead.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            **OF_FILM,
            version=version("film_ahead"),
        script:
            "../scripts/film_ahead.py"

    rule film_instants:
        input:
            scene=scene_inputs,
            light=of_scene("{scene}")["light"],
            ahead=f"{FILM_FOLDER}/ahead.json",
        output:
            temp(directory(f"{FILM_FOLDER}/{{group}}.segments")),
        log:
            "logs/film/{scene}/{group}.log",
        wildcard_constraints:
            group=r"\d{5}",
        conda:
            "../envs/lfcore.yaml"
        resources:
            runtime=film_minutes,
        params:
            **OF_FILM,
            version=version("film_instants"),
        script:
            "../scripts/film_instants.py"

    rule film:
        input:
            scene=scene_inputs,
            light=of_scene("{scene}")["light"],
            ahead=f"{FILM_FOLDER}/ahead.json",
            segments=expand(rules.film_instants.output, group=groups_of_film(), allow_missing=True),
        output:
            f"{FILM_FOLDER}.mkv",
        log:
            "logs/film/{scene}/join.log",
        conda:
            "../envs/lfcore.yaml"
        params:
            **OF_FILM,
            version=version("film"),
        script:
            "../scripts/film.py"

    rule films:
        input:
            expand(rules.film.output, scene=SCENES),
        localrule: True
