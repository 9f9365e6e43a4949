"""The sections of the pages: their files, their texts, and where the files lie."""

from pathlib import Path

import pytest

from lfcore.workflow.reports import captioned, markdown, table_sections
from lfcore.workflow.settings import check_settings


@pytest.fixture
def sections():
    return table_sections(check_settings({"scenes": ["bike"]}), ["bike", "cabin"])


def test_a_section_s_files_are_its_table_and_its_figures(sections):
    files = {one.name: one.files for one in sections}
    assert files["stability"] == [
        "results/tables/stability.csv",
        "results/tables/figures/stability_heat_map.png",
        "results/tables/figures/stability_error_growth.png",
    ]
    assert "results/tables/stability.md" in markdown(sections)
    assert files["focal_stack"] == [
        f"results/tables/figures/focal_stack_{scene}.png" for scene in ("bike", "cabin")
    ]


def test_sections_take_their_texts_and_the_places_of_their_files(sections):
    files = [file for one in sections for file in one.files]
    texts = [f"Of {one.name}." for one in sections]
    placed = captioned(sections, texts, [f".snakemake/storage/{file}" for file in files])
    for before, after in zip(sections, placed, strict=True):
        assert (after.name, after.title) == (before.name, before.title)
        assert after.caption == f"Of {before.name}."
        moved = [Path(".snakemake/storage", file) for file in before.files]
        found = [after.table] if after.table else []
        assert [*found, *after.figures.values()] == moved
        assert list(after.figures) == list(before.figures)
    with pytest.raises(ValueError):
        captioned(sections, texts, files[:-1])
