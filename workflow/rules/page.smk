# The pages of all results, and tables as Markdown. An edit of a caption runs only these rules.


rule page:
    input:
        reported=REPORTED,
        traced=expand(f"{SLAB}/trace.json", scene=SCENES, n=VIEWS[-1]),
        records=[],
        viewers=expand("results/tables/viewer/{scene}.html", scene=SCENES if STORE else []),
    output:
        page=shown("results/tables/index.html", "page", "Page"),
        markdown=MARKDOWN,
    log:
        "logs/page.log",
    group:
        REPORT_GROUP
    conda:
        "../envs/lfcore.yaml"
    params:
        version=version("page"),
        title="Synthetic light fields: tables and figures",
        sections=TABLE_SECTIONS,
        captions=captions("page", *(one["name"] for one in TABLE_SECTIONS)),
        records=[],
        facts={"M": PIXELS, "N": ", ".join(map(str, VIEWS))},
        config=config,
    script:
        "../scripts/page.py"


use rule page as assignment_page with:
    input:
        reported=ASSIGNMENT_FILES,
        traced=[],
        viewers=[],
        records=expand(f"{RECORDS}/{{name}}.json", name=ASSIGNMENT_RECORDS),
    output:
        page=shown(
            "results/assignment/index.html", "assignment_figure", "Assignment", figure="page"
        ),
        markdown=ASSIGNMENT_MARKDOWN,
    log:
        "logs/assignment/page.log",
    params:
        version=version("page"),
        title="The light field camera",
        sections=ASSIGNMENT_SECTIONS,
        captions=captions(
            "assignment_page", *(f"assignment_{one['name']}" for one in ASSIGNMENT_SECTIONS)
        ),
        records=ASSIGNMENT_RECORDS,
        facts={},
        config={"settings": SETTINGS},
