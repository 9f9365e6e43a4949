"""What an edit runs again: versions follow the imports of a rule's script."""

import shutil
from pathlib import Path

import pytest

from lfcore import versions

ROOT = Path(__file__).resolve().parents[2]
SCRIPTS = ROOT / "workflow/scripts"


def files_behind(script):
    found = versions._imported(SCRIPTS / f"{script}.py")
    return {file.relative_to(ROOT).as_posix() for file in found}


@pytest.mark.parametrize(
    ("script", "has", "has_not"),
    [
        ("trace", "lfcore/tracing/kernels/entry/trace.cl", "lfcore/api.py"),
        ("trace", "lfcore/rendering/record.py", "lfcore/workflow/sweep.py"),  # imported late
        ("parse", "lfcore/scene/procedural/bike.py", "lfcore/tracing/bvh.py"),  # by a text's name
        ("dataset_batch", "lfcore/datasets/items.py", "lfcore/datasets/card.py"),
        ("page", "lfcore/evaluation/page.css", "lfcore/tracing/tracer.py"),
        ("evaluate", "lfcore/evaluation/thesis_tables.csv", "lfcore/evaluation/page.css"),
        ("retrieve", "lfcore/lightfield.py", "lfcore/evaluation/page.py"),  # by its public name
    ],
)
def test_a_script_has_the_files_behind_it_and_no_others(script, has, has_not):
    found = files_behind(script)
    assert has in found and (ROOT / has_not).is_file() and has_not not in found


def test_an_edit_is_another_version(tmp_path, monkeypatch):
    library = tmp_path / "lfcore"
    shutil.copytree(ROOT / "lfcore", library, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(versions, "LIBRARY", library)
    scripts = [SCRIPTS / f"{name}.py" for name in ("page", "trace")]
    before = list(map(versions.version.__wrapped__, scripts))
    (library / "evaluation/page.css").write_text("")
    page, trace = map(versions.version.__wrapped__, scripts)
    assert page != before[0] and trace == before[1]


def test_the_commit_is_that_of_the_librarys_own_checkout(tmp_path, monkeypatch):
    assert not (ROOT / ".git").exists() or len(versions.commit()) == 40
    (tmp_path / ".git").mkdir()  # of somebody's project with an environment in it
    monkeypatch.setattr(versions, "LIBRARY", tmp_path / "site-packages/lfcore")
    assert versions.commit() == ""
