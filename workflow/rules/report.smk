# One page over everything that the stages above have entered in SECTIONS.
#
# "results/tables" is a folder of separate files, so its two spellings are rules without outputs:
# as a directory() output, a deleted table would not be noticed.
TITLES = {
    "table_7_1": "Table 7.1: angular resolution",
    "table_7_2": "Table 7.2: encoding",
    "table_7_3": "Table 7.3: retrieval",
}
for table in TABLES:
    SECTIONS[table] = {"title": TITLES[table], "table": f"results/tables/{table}.csv"}
    if wanted("quality"):
        SECTIONS[table]["figures"] = {"": f"results/tables/figures/{table}_curves.png"}

REPORTED = [
    *(section["table"] for section in SECTIONS.values() if "table" in section),
    *(file for section in SECTIONS.values() for file in section.get("figures", {}).values()),
]


rule page:
    input:
        reported=REPORTED,
        traced=expand("results/{scene}/N{n}/trace.json", scene=SCENES, n=RESOLUTIONS[-1]),
        captions=[caption_of(name) for name in ["page", *SECTIONS]],
    output:
        report("results/tables/index.html", caption="../report/page.rst", category="Page"),
    log:
        "logs/page.log",
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=sources("page.py"),
        sections=SECTIONS,
        config=SETTINGS,
    script:
        "../scripts/page.py"


rule:
    name:
        "results/tables"
    input:
        REPORTED,
        "results/tables/index.html",
    localrule: True


rule:
    name:
        "results/tables/"
    input:
        REPORTED,
        "results/tables/index.html",
    localrule: True
