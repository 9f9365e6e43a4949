"""What the pages show, in order: sections of a table, figures, or both."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from lfcore.evaluation.page import Section

TABLES = Path("results/tables")
ASSIGNMENT = Path("results/assignment")
THESIS = {
    "table_7_1": "Table 7.1: angular resolution",
    "table_7_2": "Table 7.2: encoding",
    "table_7_3": "Table 7.3: retrieval",
}
SHEETS = {
    "focal_stack": "Focal stack",
    "aperture_stack": "Aperture stack",
    "sub_aperture_views": "Sub-aperture views",
}
STORAGE = {
    "storage_layouts": "Layouts of the stored light field",
    "rate_distortion": "Rate against distortion",
    "equivalence": "One picture made in four ways",
    "retrieval": "What it costs to read a stored light field",
}
ANALYSES = {
    "true_picture": "The true picture",
    "work_precision": "Error against run time",
    "recommendation": "Recommended settings",
    "stability": "Stiff and extreme cases",
    "left_out": "Nothing a scene does not need",
}
PANELS = {
    "true_picture": ("run_time",),
    "work_precision": ("quadrature", "convergence", "tracing", "recorded", "storage", "arithmetic"),
    "stability": ("heat_map", "error_growth"),
}
ARRAY_TABLES = {"camera_array": "Camera arrays", "reconstruction": "Pictures from camera arrays"}
ASSIGNMENT_FIGURES = {
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
BOOK_FIGURES = ("synthesis", "focal_surfaces", "realistic_lens")
SAMPLING_FIGURES = ("few_cameras", "equal_storage")
OF_BOOK = (*BOOK_FIGURES, *SAMPLING_FIGURES, "reconstruction")
OTHER = {
    "bd_rate": "Bits at equal quality (BD-rate)",
    "other_renderers": "Other ray tracers",
    "plenoptic_photograph": "Photographs of a plenoptic camera",
    "our_choice": "What we would do",
    "chosen_rays": "Rays chosen for a quality",
}
TITLES = {**THESIS, **SHEETS, **STORAGE, **ANALYSES, **ARRAY_TABLES, **OTHER}
"""Of every table and figure of results/tables/."""


def markdown(sections: Iterable[Section]) -> list[str]:
    """The tables of sections as Markdown, which their page writes."""
    return [str(one.table.with_suffix(".md")) for one in sections if one.table]


def captioned(
    sections: Sequence[Section], captions: Iterable[str], files: Iterable[str]
) -> list[Section]:
    """The sections with their texts, and their files where they lie: from object storage they come
    to another folder."""
    names = [name for one in sections for name in one.files]
    place = {Path(name): Path(file) for name, file in zip(names, files, strict=True)}
    return [
        replace(
            one, caption=caption, table=one.table and place[one.table],
            figures={label: place[file] for label, file in one.figures.items()},
        )
        for one, caption in zip(sections, captions, strict=True)
    ]  # fmt: skip


def _figure(name: str) -> Path:
    return TABLES / "figures" / f"{name}.png"


def table_sections(settings: Mapping, scenes: Iterable[str]) -> list[Section]:
    """The sections of results/tables/ that a configuration asks for."""
    return [
        Section(name, TITLES[name], "", TABLES / f"{name}.csv" if table else None, figures)
        for name, table, figures in _wanted(settings, list(scenes))
    ]


def _wanted(settings: Mapping, scenes: list[str]) -> Iterator[tuple[str, bool, dict[str, Path]]]:
    """Name, whether it has a table, and figures by label."""
    figures, store = settings["figures"]["make"], settings["store"]
    for name in thesis_tables(settings):
        yield name, True, {"": _figure(f"{name}_curves")} if "quality" in figures else {}
    if settings["angular_resolution"] == "auto":
        yield "chosen_rays", True, {}
    for name in SHEETS:
        if name in figures:
            yield name, False, {scene: _figure(f"{name}_{scene}") for scene in scenes}
    if "plenoptic_photograph" in figures:
        yield "plenoptic_photograph", False, {"": _figure("plenoptic_photograph")}
    if "other_renderers" in figures:
        yield "other_renderers", True, {"": _figure("other_renderers")}
    for name in STORAGE:
        if name in settings["storage"]["make"] and (store or name != "retrieval"):
            per_scene = name in ("rate_distortion", "equivalence")
            labels = {scene: f"{name}_{scene}" for scene in scenes} if per_scene else {"": name}
            yield name, True, {label: _figure(file) for label, file in labels.items()}
            if name == "rate_distortion":
                yield "bd_rate", True, {}
    for name in ANALYSES:
        if name in settings["analysis"]["make"]:
            panels = PANELS.get(name, ())
            yield name, True, {p.replace("_", " "): _figure(f"{name}_{p}") for p in panels}
            if name == "true_picture" and store:
                yield "our_choice", True, {}
    if settings["assignment"]["in_tables"]:
        yield "camera_array", True, {}
        yield "reconstruction", True, {"": ASSIGNMENT / "figures/reconstruction.png"}


def thesis_tables(settings: Mapping) -> list[str]:
    """The thesis's tables; what is not stored has no table of storage."""
    return list(THESIS) if settings["store"] else ["table_7_1"]


def assignment_sections(settings: Mapping) -> list[Section]:
    """The sections of results/assignment/: studies whose scene is there, and the tables."""
    assignment = settings["assignment"]
    scenes = assignment["scenes"]
    left_out = set(() if "book" in scenes else OF_BOOK)
    if assignment["see_through"]["scene"] not in scenes:
        left_out.add("see_through")
    made = [
        Section(name, title, figures={"": ASSIGNMENT / "figures" / f"{name}.png"})
        for name, title in ASSIGNMENT_FIGURES.items()
        if name not in left_out
    ]
    if "book" in scenes:
        made += [
            Section(f"table_{name}", f"Table: {title.lower()}", "", ASSIGNMENT / f"{name}.csv")
            for name, title in ARRAY_TABLES.items()
        ]
    return made


def assignment_records(sections: Iterable[Section]) -> list[str]:
    """Records of measurements of which the captions of these sections speak."""
    of_figure = dict.fromkeys(BOOK_FIGURES, "book") | dict.fromkeys(SAMPLING_FIGURES, "sampling")
    of_figure |= {name: name for name in ("see_through", "time", "reconstruction")}
    names = (of_figure.get(section.name) for section in sections)
    return list(dict.fromkeys(name for name in names if name))
