"""Files appear whole or not at all, also when the process is killed."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

from lfcore.errors import StorageError
from lfcore.files import draft_folder, whole_file, write_json, write_text
from lfcore.pictures import write_pictures

BIG = np.random.default_rng(0).random((96, 96, 3)).astype(np.float32)


def test_several_pictures_appear_together_or_not_at_all(tmp_path):
    (tmp_path / "taken.png").mkdir()
    with pytest.raises(StorageError):
        write_pictures([(tmp_path / "a.png", BIG), (tmp_path / "taken.png", BIG)])
    assert [entry.name for entry in tmp_path.iterdir()] == ["taken.png"]


def test_an_exception_leaves_the_old_file(tmp_path):
    write_json(tmp_path / "f.json", {"a": 1})
    with pytest.raises(RuntimeError), whole_file(tmp_path / "f.json") as file:
        file.write(b"half")
        raise RuntimeError
    assert json.loads((tmp_path / "f.json").read_text()) == {"a": 1}
    assert len(list(tmp_path.iterdir())) == 1


HOLD = """
import sys, time
from lfcore.files import draft_folder, whole_file
with whole_file(sys.argv[1]) as file, draft_folder(sys.argv[1]) as folder:
    file.write(b"half")
    (folder / "segment").write_bytes(b"half")
    print("holds", flush=True)
    time.sleep(60)
"""


def test_drafts_of_a_killed_run_are_cleared_and_those_of_a_living_one_kept(tmp_path):
    write = [sys.executable, "-c", "import sys; from lfcore.files import write_text; "
             "write_text(sys.argv[1], 'whole')"]  # fmt: skip
    path = str(tmp_path / ("a name of many bytes \N{SNOWMAN}" * 6 + ".bin"))
    with subprocess.Popen([sys.executable, "-c", HOLD, path], stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"holds\n"
        assert len(list(tmp_path.iterdir())) == 2
        subprocess.run([*write, str(tmp_path / "b")], check=True, timeout=60)
        assert len(list(tmp_path.iterdir())) == 3
        other.kill()
    subprocess.run([*write, str(tmp_path / "c")], check=True, timeout=60)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["b", "c"]


def test_a_draft_has_the_rights_of_any_new_file(tmp_path):
    old = os.umask(0o027)
    try:
        write_text(tmp_path / "f", "text")
        with draft_folder(tmp_path / "g") as folder:
            assert folder.stat().st_mode & 0o777 == 0o750
    finally:
        os.umask(old)
    assert (tmp_path / "f").stat().st_mode & 0o777 == 0o640
