# What the pages show, in order: sections of a table, figures, or both.
# Tables of storage need a stored light field.
THESIS_TABLES = ["table_7_1", "table_7_2", "table_7_3"] if STORE else ["table_7_1"]
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


def section(name, title, table=None, figures=None):
    """The arguments of a section of a page, but for its caption."""
    return {"name": name, "title": title, "table": table, "figures": figures or {}}


def files_of(sections):
    """The table and the figures of each section."""
    return [file for one in sections for file in (one["table"], *one["figures"].values()) if file]


def unlabelled(name):
    return {"": f"results/tables/figures/{name}.png"}


def by_scene(name):
    return {scene: f"results/tables/figures/{name}_{scene}.png" for scene in SCENES}


def panels(*labels):
    return lambda name: {
        label.replace("_", " "): f"results/tables/figures/{name}_{label}.png" for label in labels
    }


def curves(name):
    return unlabelled(f"{name}_curves") if "quality" in REPORTS else {}


# The sections of results/tables/: title, whether there is a table, figures. First the thesis's own, in
# its order: figures 4.2 to 4.6 and 6.3, tables 7.1 to 7.3.
SECTIONS = {
    "focal_stack": ("Focal stack", False, by_scene),
    "aperture_stack": ("Aperture stack", False, by_scene),
    "other_renderers": ("Other ray tracers", True, unlabelled),
    "plenoptic_photograph": ("Photographs of a plenoptic camera", False, unlabelled),
    "sub_aperture_views": ("Sub-aperture views", False, by_scene),
    "table_7_1": ("Table 7.1: angular resolution", True, curves),
    "table_7_2": ("Table 7.2: encoding", True, curves),
    "table_7_3": ("Table 7.3: retrieval", True, curves),
    "recipes": ("The thesis's recipe and slicing by depth", False, by_scene),
    "chosen_rays": ("Which rays should I choose?", True, panels()),
    "work_precision": ("Error against run time", True, panels("on_the_fly", "stored")),
    "storage_layouts": ("Layouts of the stored light field", True, unlabelled),
    "rate_distortion": ("Rate against distortion", True, by_scene),
    "bd_rate": ("Bits at equal quality (BD-rate)", True, panels()),
    "equivalence": ("One picture made in four ways", True, by_scene),
    "retrieval": ("What it costs to read a stored light field", True, unlabelled),
    "stability": ("Stiff and extreme cases", True, panels("heat_map", "error_growth")),
    "left_out": ("Nothing a scene does not need", True, panels()),
    "camera_array": (ARRAY_TABLES["camera_array"], True, panels()),
    "reconstruction": (
        ARRAY_TABLES["reconstruction"],
        True,
        lambda name: {"": "results/assignment/figures/reconstruction.png"},
    ),
}
# Reports whose sections have other names.
REPORT_OF = {"bd_rate": "rate_distortion", **dict.fromkeys(ARRAY_TABLES, "camera_arrays")}
SHOWN = REPORTS if STORE else REPORTS - {"chosen_rays", "retrieval"}


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


TABLE_SECTIONS = [
    section(name, title, f"results/tables/{name}.csv" if has_table else None, figures(name))
    for name, (title, has_table, figures) in SECTIONS.items()
    if name in THESIS_TABLES or REPORT_OF.get(name, name) in SHOWN
]
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
