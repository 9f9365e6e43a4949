# The pages over all that the stages above have made, and tables as Markdown. What only words a
# caption, or shows what was measured, is here: it measures nothing again.
#
# "results/tables" is a folder of separate files, so its two spellings are rules without outputs:
# as a directory() output, a deleted table would not be noticed.
REPORTED = [file for section in TABLE_SECTIONS for file in section.files]
PAGE_SOURCES = digest("workflow/reports.py", "evaluation/page.*", "evaluation/table_files.py")


rule page:
    input:
        reported=REPORTED,
        traced=expand(f"{SLAB}/trace.json", scene=SCENES, n=RESOLUTIONS[-1]),
        records=[],
        viewers=expand("results/tables/viewer/{scene}.html", scene=SCENES if STORE else []),
        captions=[caption_of(name) for name in ["page", *(one.name for one in TABLE_SECTIONS)]],
    output:
        page=shown("results/tables/index.html", "page", "Page"),
        markdown=reports.markdown(TABLE_SECTIONS),
    log:
        "logs/page.log",
    group:
        at_home(REPORT_GROUP)
    conda:
        "../envs/lfcore.yaml"
    params:
        sources=PAGE_SOURCES,
        title="Synthetic light fields: tables and figures",
        sections=TABLE_SECTIONS,
        records=[],
        facts={"M": PIXELS, "N": ", ".join(map(str, RESOLUTIONS))},
        config=SETTINGS,
    script:
        "../scripts/page.py"


use rule page as assignment_page with:
    input:
        reported=ASSIGNMENT_FILES,
        traced=[],
        viewers=[],
        records=expand(
            f"{RECORDS}/{{name}}.json", name=reports.assignment_records(ASSIGNMENT_SECTIONS)
        ),
        captions=[
            caption_of(name)
            for name in ["assignment_page", *(f"assignment_{s.name}" for s in ASSIGNMENT_SECTIONS)]
        ],
    output:
        page=shown(
            "results/assignment/index.html", "assignment_figure", "Assignment", figure="page"
        ),
        markdown=reports.markdown(ASSIGNMENT_SECTIONS),
    log:
        "logs/assignment/page.log",
    params:
        sources=PAGE_SOURCES,
        title="The light field camera",
        sections=ASSIGNMENT_SECTIONS,
        records=reports.assignment_records(ASSIGNMENT_SECTIONS),
        facts={},
        config={"assignment": ARRAY},


for folder, files in (
    ("results/tables", [*REPORTED, *rules.page.output]),
    ("results/assignment", [*ASSIGNMENT_FILES, *QUICK_TABLES, *rules.assignment_page.output]),
):
    for spelling in (folder, f"{folder}/"):

        rule:
            name:
                spelling
            input:
                files,
            localrule: True
