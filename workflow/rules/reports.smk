# What the pages show, in order: sections of a table, figures, or both.
# Tables of storage need a stored light field.
if not STORE:
    THESIS_TABLES = THESIS_TABLES[:1]
ARRAY_TABLES = {name: REPORT_RECORDS[name]["title"] for name in ("camera_array", "reconstruction")}
ASSIGNMENT_TITLES = {
    "light_fields": "Step 2: light fields",
    "synthesis": "Steps 3 and 4: pictures of the book",
    "see_through": "Step 4: seeing through trees",
    "focal_surfaces": "Step 5: focal surfaces",
    "realistic_lens": "Step 5: a realistic lens",
    "few_cameras": "Step 6: few cameras",
    "equal_storage": "Step 6: many cameras of few pixels",
    "time": "Step 6: time",
    "reconstruction": "Error, run time and convergence",
}
BOOK_FIGURES = ["synthesis", "focal_surfaces", "realistic_lens"]
SAMPLING_FIGURES = ["few_cameras", "equal_storage"]
# The records of measurements that captions of the assignment's page read.
RECORD_OF = {
    **dict.fromkeys(BOOK_FIGURES, "book"),
    **dict.fromkeys(SAMPLING_FIGURES, "sampling"),
    **{name: name for name in ("see_through", "time", "reconstruction")},
}


def section(name, title, table=None, figures=None):
    """The arguments of a section of a page, but for its caption."""
    return {"name": name, "title": title, "table": table, "figures": figures or {}}


def files_of(sections):
    """The table and the figures of each section."""
    return [file for one in sections for file in (one["table"], *one["figures"].values()) if file]


def figures_of(name, form):
    """The figures of a report by label; its record says which."""
    if form == "scene":
        return {scene: f"results/tables/figures/{name}_{scene}.png" for scene in SCENES}
    if form == "curves":
        form = ["curves"] if "quality" in REPORTS else []
    if isinstance(form, list):
        labels = [one.replace("_", " ") if len(form) > 1 else "" for one in form]
        files = [f"results/tables/figures/{name}_{one}.png" for one in form]
        return dict(zip(labels, files))
    folders = {"one": "results/tables/figures", "assignment": "results/assignment/figures"}
    return {"": f"{folders[form]}/{name}.png"} if form in folders else {}


SHOWN = REPORTS if STORE else REPORTS - {"chosen_rays", "retrieval"}


def shown_section(name, record):
    """A section of results/tables/, as its record has it."""
    file = f"results/tables/{name}.csv" if record.get("table") else None
    return section(name, record["title"], file, figures_of(name, record.get("figures")))


TABLE_SECTIONS = [
    shown_section(name, one)
    for name, one in REPORT_RECORDS.items()
    if name in THESIS_TABLES or one.get("with", name) in SHOWN
]
ASSIGNMENT_SECTIONS = [
    section(name, title, figures={"": f"results/assignment/figures/{name}.png"})
    for name, title in ASSIGNMENT_TITLES.items()
] + [
    section(f"table_{name}", f"Table: {title.lower()}", f"results/assignment/{name}.csv")
    for name, title in ARRAY_TABLES.items()
]
REPORTED = files_of(TABLE_SECTIONS)
ASSIGNMENT_FILES = files_of(ASSIGNMENT_SECTIONS)
ASSIGNMENT_RECORDS = list(
    dict.fromkeys(RECORD_OF[one["name"]] for one in ASSIGNMENT_SECTIONS if one["name"] in RECORD_OF)
)


def markdown(sections):
    """The tables of sections as Markdown, which their page writes."""
    return [str(Path(one["table"]).with_suffix(".md")) for one in sections if one["table"]]


MARKDOWN, ASSIGNMENT_MARKDOWN = markdown(TABLE_SECTIONS), markdown(ASSIGNMENT_SECTIONS)
