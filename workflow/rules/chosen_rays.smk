# Light fields whose rays a pilot chooses for a quality.
CHOSEN = f"results/{{scene}}/M{PIXELS}/auto"
CHOSEN_FILES = {
    "rows": f"{CHOSEN}/chosen_rays.json",
    "stack": f"{CHOSEN}/planes.npz",
    "pictures": directory(f"{CHOSEN}/planes"),
}
if STORE:
    CHOSEN_FILES["light_field"] = f"{CHOSEN}/lightfield.mkv"


rule chosen_rays_scene:
    input:
        **of_scene("{scene}"),
        truth=TRUTHS["wide"],
    output:
        **CHOSEN_FILES,
    log:
        "logs/chosen_rays/{scene}.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        **of_settings("pixels", "planes", "picture_format", "encoding", "layout", "device"),
        quality_db=ANALYSIS["chosen_rays"]["quality_db"],
        version=version("report"),
    script:
        "../scripts/chosen_rays_scene.py"
