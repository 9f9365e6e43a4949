# What the pages show, in order: sections of a table, figures, or both.
THESIS = {
    "table_7_1": "Table 7.1: angular resolution",
    "table_7_2": "Table 7.2: encoding",
    "table_7_3": "Table 7.3: retrieval",
}
SHEETS = {
    "focal_stack": "Focal stack",
    "aperture_stack": "Aperture stack",
    "sub_aperture_views": "Sub-aperture views",
    "recipes": "The thesis's recipe and slicing by depth",
}
PLENOPTIC = {"plenoptic_photograph": "Photographs of a plenoptic camera"}
RENDERERS = {"other_renderers": "Other ray tracers"}
STORAGE_REPORTS = {
    "storage_layouts": "Layouts of the stored light field",
    "rate_distortion": "Rate against distortion",
    "equivalence": "One picture made in four ways",
    "retrieval": "What it costs to read a stored light field",
}
ANALYSES = {
    "work_precision": "Error against run time",
    "stability": "Stiff and extreme cases",
    "left_out": "Nothing a scene does not need",
}
PANELS = {
    "work_precision": ["on_the_fly", "stored"],
    "stability": ["heat_map", "error_growth"],
}
ARRAY_TABLES = {"camera_array": "Camera arrays", "reconstruction": "Pictures from camera arrays"}
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
# Tables of storage need a stored light field.
THESIS_TABLES = list(THESIS) if STORE else ["table_7_1"]


def section(name, title, table=None, figures=None):
    """The arguments of a section of a page, but for its caption."""
    return {"name": name, "title": title, "table": table, "figures": figures or {}}


def files_of(sections):
    """The tables and figures of sections."""
    tables = [one["table"] for one in sections if one["table"]]
    return tables + [file for one in sections for file in one["figures"].values()]


def table_sections():
    """The sections of results/tables/."""

    def tables_figure(name):
        return f"results/tables/figures/{name}.png"

    def of_scenes_figures(name):
        return {scene: tables_figure(f"{name}_{scene}") for scene in SCENES}

    def made(name, title, figures=None):
        return section(name, title, f"results/tables/{name}.csv", figures)

    for name in THESIS_TABLES:
        curves = {"": tables_figure(f"{name}_curves")} if "quality" in REPORTS else {}
        yield made(name, THESIS[name], curves)
    if "chosen_rays" in REPORTS and STORE:
        yield made("chosen_rays", "Which rays should I choose?")
    for name, title in SHEETS.items():
        if name in REPORTS:
            yield section(name, title, figures=of_scenes_figures(name))
    for name, title in PLENOPTIC.items():
        if name in REPORTS:
            yield section(name, title, figures={"": tables_figure(name)})
    for name, title in RENDERERS.items():
        if name in REPORTS:
            yield made(name, title, {"": tables_figure(name)})
    for name, title in STORAGE_REPORTS.items():
        if name in REPORTS and (STORE or name != "retrieval"):
            per_scene = name in ("rate_distortion", "equivalence")
            yield made(
                name, title, of_scenes_figures(name) if per_scene else {"": tables_figure(name)}
            )
            if name == "rate_distortion":
                yield made("bd_rate", "Bits at equal quality (BD-rate)")
    for name, title in ANALYSES.items():
        if name in REPORTS:
            panels = PANELS.get(name, [])
            figures = {
                panel.replace("_", " "): tables_figure(f"{name}_{panel}") for panel in panels
            }
            yield made(name, title, figures)
    if "camera_arrays" in REPORTS:
        yield made("camera_array", ARRAY_TABLES["camera_array"])
        yield made(
            "reconstruction",
            ARRAY_TABLES["reconstruction"],
            {"": "results/assignment/figures/reconstruction.png"},
        )


def assignment_sections():
    """The sections of results/assignment/: the studies whose scene is there, and the tables."""
    scenes = config["assignment"]["scenes"]
    left_out = set()
    if "book" not in scenes:
        left_out |= {*BOOK_FIGURES, *SAMPLING_FIGURES, "reconstruction"}
    if config["assignment"]["see_through"]["scene"] not in scenes:
        left_out.add("see_through")
    for name, title in ASSIGNMENT_TITLES.items():
        if name not in left_out:
            yield section(name, title, figures={"": f"results/assignment/figures/{name}.png"})
    if "book" in scenes:
        for name, title in ARRAY_TABLES.items():
            file = f"results/assignment/{name}.csv"
            yield section(f"table_{name}", f"Table: {title.lower()}", file)


TABLE_SECTIONS = list(table_sections())
REPORTED = files_of(TABLE_SECTIONS)
ASSIGNMENT_SECTIONS = list(assignment_sections())
ASSIGNMENT_FILES = files_of(ASSIGNMENT_SECTIONS)
ASSIGNMENT_RECORDS = list(
    dict.fromkeys(RECORD_OF[one["name"]] for one in ASSIGNMENT_SECTIONS if one["name"] in RECORD_OF)
)


def markdown(sections):
    """The tables of sections as Markdown, which their page writes."""
    return [str(Path(one["table"]).with_suffix(".md")) for one in sections if one["table"]]


MARKDOWN, ASSIGNMENT_MARKDOWN = markdown(TABLE_SECTIONS), markdown(ASSIGNMENT_SECTIONS)
