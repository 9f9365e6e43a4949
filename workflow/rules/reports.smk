# The pages' sections in order, each with a table, figures, or both.
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
# The measurements that captions of the assignment's page read.
RECORD_OF = {
    **dict.fromkeys(BOOK_FIGURES, "book"),
    **dict.fromkeys(SAMPLING_FIGURES, "sampling"),
    **{name: name for name in ("see_through", "time", "reconstruction")},
}


def section(name, title, table=None, figures=None):
    """Return a section's arguments, without its caption."""
    return {"name": name, "title": title, "table": table, "figures": figures or {}}


def files_of(sections):
    """Return the table and the figures of each section."""
    return [file for s in sections for file in (s["table"], *s["figures"].values()) if file]


def figures_of(name, form):
    """Return a report's figures by label; ``form`` is the key ``figures`` of its record."""
    if form == "scene":
        return {scene: f"results/tables/figures/{name}_{scene}.png" for scene in SCENES}
    if form == "curves":
        form = ["curves"] if "quality" in REPORTS else []
    if isinstance(form, list):
        labels = [part.replace("_", " ") if len(form) > 1 else "" for part in form]
        files = [f"results/tables/figures/{name}_{part}.png" for part in form]
        return dict(zip(labels, files))
    folders = {"one": "results/tables/figures", "assignment": "results/assignment/figures"}
    return {"": f"{folders[form]}/{name}.png"} if form in folders else {}


SHOWN = REPORTS if STORE else REPORTS - {"chosen_rays", "retrieval"}


def shown_section(name, record):
    """Return a section of results/tables/, from its record."""
    file = f"results/tables/{name}.csv" if record.get("table") else None
    return section(name, record["title"], file, figures_of(name, record.get("figures")))


TABLE_SECTIONS = [
    shown_section(name, record)
    for name, record in REPORT_RECORDS.items()
    if name in THESIS_TABLES or record.get("with", name) in SHOWN
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
    dict.fromkeys(RECORD_OF[s["name"]] for s in ASSIGNMENT_SECTIONS if s["name"] in RECORD_OF)
)


def markdown(sections):
    """Return the tables of sections as Markdown, which their page writes."""
    return [str(Path(s["table"]).with_suffix(".md")) for s in sections if s["table"]]


MARKDOWN, ASSIGNMENT_MARKDOWN = markdown(TABLE_SECTIONS), markdown(ASSIGNMENT_SECTIONS)
