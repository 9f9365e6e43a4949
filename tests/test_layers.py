"""Imports go one way, as .importlinter says, which names each package and what it may not see."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_each_package_imports_only_those_below_it():
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run([linter], cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-3000:]
    assert "4 kept, 0 broken" in done.stdout


def test_a_forbidden_import_is_found(tmp_path):
    """The check can fail: a scene that imports the store."""
    package = tmp_path / "lfcore"
    for name in ("scene", "storage"):
        (package / name).mkdir(parents=True)
        (package / name / "__init__.py").touch()
    (package / "__init__.py").touch()
    (package / "scene" / "model.py").write_text("import lfcore.storage\n")
    layers = (ROOT / ".importlinter").read_text()
    layers = layers.replace("exhaustive = True", "exhaustive = False")
    layers = layers[: layers.index("[importlinter:contract:oracle]")]
    head, listed = layers.split("layers =\n")
    # Layers that this small package lacks are optional, which brackets say.
    listed = "".join(
        f"    {' | '.join(f'({part})' for part in line.strip().split(' | '))}\n"
        for line in listed.splitlines()
        if line.strip()
    )
    layers = f"{head}layers =\n{listed}"
    (tmp_path / ".importlinter").write_text(layers)
    linter = Path(sys.executable).with_name("lint-imports")
    done = subprocess.run(
        [linter], cwd=tmp_path, capture_output=True, text=True, timeout=120,
        env={"PYTHONPATH": str(tmp_path), "PATH": "/usr/bin"},
    )  # fmt: skip
    assert done.returncode != 0 and "lfcore.scene.model -> lfcore.storage" in done.stdout, (
        done.stdout + done.stderr
    )


def test_tests_mirror_the_library():
    """A folder of tests is a package's, but for what lies outside the library."""
    folders = {
        path.parent.relative_to(ROOT / "tests").parts for path in ROOT.glob("tests/*/test_*")
    }
    own = {("robustness",)}
    assert all((ROOT / "lfcore").joinpath(*parts).is_dir() for parts in folders - own)
