"""One version in all files that name it."""

import json
from pathlib import Path

import yaml

import lfcore

ROOT = Path(__file__).resolve().parents[1]


def test_citation_archive_and_changelog_have_the_librarys_version():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    archive = json.loads((ROOT / ".zenodo.json").read_text())
    for key, value in {"version": lfcore.__version__, "license": "MIT"}.items():
        assert citation[key] == archive[key] == value
    assert citation["title"] == archive["title"] and citation["keywords"] == archive["keywords"]
    assert [one["name"] for one in citation["authors"]] == [
        one["name"] for one in archive["creators"]
    ]
    assert f"\n## [{lfcore.__version__}]" in (ROOT / "CHANGELOG.md").read_text()
