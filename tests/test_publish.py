"""Published numbers: documents are what their result files make of them."""

import pandas as pd
import pytest

from benchmarks import publish

PROVENANCE = {"command": "make x", "commit": "abc", "processor": "a machine", "date": "2026-01-02"}
PLACE = "<!-- published: some: N; s where N in 2 3 4 and more in 0 -->"
TEXT = f"Before.\n{PLACE}\nold\n<!-- end of some -->\nAfter.\n"


@pytest.fixture
def results(tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "RESULTS", tmp_path)
    rows = pd.DataFrame({"N": [2, 3, 4], "s": ["1.50", "2.0", "inf"], "more": [0, 1, 0]})
    publish.Result(PROVENANCE | {"note": "Hot."}, rows).write(tmp_path / "some.csv")
    return tmp_path


def test_a_place_is_filled_with_its_rows_and_columns(results):
    made = publish.published(TEXT)
    assert "| N | s |\n|---|---|\n| 2 | 1.50 |\n| 4 | inf |\n" in made
    assert "Made by `make x`: commit abc, 2026-01-02, a machine. Hot." in made
    assert made.startswith("Before.\n") and made.endswith("After.\n") and "old" not in made
    assert publish.published(made) == made


def test_what_cannot_be_published(results):
    with pytest.raises(publish.PublishError, match="no column 'absent'"):
        publish.published(TEXT.replace("N; s", "N; absent"))
    (results / "some.csv").write_text("# command: x\nN\n1\n")
    with pytest.raises(publish.PublishError, match="does not say its commit, processor, date"):
        publish.published(TEXT)
    (results / "some.csv").unlink()
    with pytest.raises(publish.PublishError, match=r"some\.csv: cannot be read"):
        publish.published(TEXT)


def test_a_part_of_a_result_is_made_anew(results):
    found = publish.with_kept(pd.DataFrame({"N": ["3"], "s": ["9"]}), "some", "N")
    assert found[["N", "s"]].values.tolist() == [["3", "9"], ["2", "1.50"], ["4", "inf"]]
    assert list(found.columns) == ["N", "s", "commit"]


def test_errors_that_the_truth_can_judge_are_published(tmp_path):
    rows = [  # panel, method, setting, seconds, dB, note
        ("on the fly", "nearest pixel", "512 x 1", 8.0, 30, None),
        ("on the fly", "by depth", "4 x 2", 0.5, 44, None),
        ("on the fly", "by depth", "8 x 3", 1.0, 58, "not judged"),
        ("on the fly", "nearest pixel", "16 x 1", 0.1, 29, None),
        ("from a file", "by depth", "4 x 2", 0.1, 43, None),
    ]
    names = ["panel", "method", "setting", "seconds", "psnr_true_db", "note"]
    table = pd.DataFrame(rows, columns=names).assign(scene="a", f_number=1.0, rays_per_pixel=64)
    table.to_csv(tmp_path / "work_precision.csv", index=False)
    found = publish.true_picture(tmp_path)
    assert list(found.lattice) == ["512 x 1", "4 x 2"]
    assert list(found["worst dB"]) == ["30.0", "44.0"]
    assert list(found["of N = 512"]) == ["1/1", "1/16"]


def test_a_run_is_taken_with_its_commit(results, tmp_path, monkeypatch):
    monkeypatch.setattr(publish, "documents", dict)
    folder = tmp_path / "tables"
    folder.mkdir()
    key = {"scene": ["bike"], "N": [16], "seconds": [0.123]}
    for name, more in (
        ("table_7_1", {"psnr_db": [43.26], "psnr_true_db": [32.81], "ssim": [0.98765]}),
        ("table_7_2", {"ratio_float32": [148.6]}),
        ("table_7_3", {"psnr_db": [float("inf")], "psnr_true_db": [32.8], "ssim": [1.0]}),
    ):
        pd.DataFrame(key | more).to_csv(folder / f"{name}.csv", index=False)
    assert publish.main(["--check", "--take", "some", "--command", "make tables", str(folder)]) == 0
    result = publish.read_result(results / "some.csv")
    assert result.provenance["command"] == "make tables" and len(result.provenance["commit"]) >= 7
    assert result.rows.iloc[0].tolist() == [
        "bike", "16", "0.1", "43.3", "32.8", "0.9877", "0.1", "149", "0.1", "inf", "32.8", "1.0000",
    ]  # fmt: skip


def test_peers_stand_beside_the_better_of_their_ways(tmp_path):
    rows = [
        ("lfcore", "visibility", 90.0), ("embree, 4 x 4 pixels", "visibility", 30.0),
        ("embree, 4 x 4 lens samples", "visibility", 20.0), ("lfcore", "algorithm1", 25.0),
    ]  # fmt: skip
    mitsuba = ("mitsuba llvm_ad_rgb", "algorithm1", 5.0)
    for made, names in ((rows, []), ([*rows, mitsuba], [publish.PICTURES, "Mitsuba 3"])):
        table = pd.DataFrame(made, columns=["method", "work", "mrays_per_core_second"])
        table.assign(scene="bike", N=16).to_csv(tmp_path / "t.csv", index=False)
        (row,) = publish.peers(tmp_path / "t.csv").to_dict("records")
        assert (row["Embree 3"], row["times Embree"]) == ("30", "3")
        assert [row.get(name) for name in names] == ["25", "5"][: len(names)]
