"""Try the installed library, alone: scene, picture, light field, refocused picture, commands."""

import importlib.util
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

import lfcore

HEAVY = (
    "snakemake", "pandas", "matplotlib", "docutils", "jinja2", "bjontegaard", "tabulate", "skimage",
)  # fmt: skip


def main() -> None:
    here = Path(lfcore.__file__).parent
    assert "site-packages" in here.parts, f"{here} is not the wheel"
    assert (here / "py.typed").is_file() and list(here.glob("**/*.cl"))
    there = [name for name in HEAVY if importlib.util.find_spec(name)]
    assert not there, f"the library drags in {there}"
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        triangles = np.array([[[-1, -1, 0], [1, -1, 0], [0, 1, 0]]], float)
        scene = lfcore.Scene.from_triangles(triangles)
        picture = lfcore.render(scene, pixels=32, views=4)
        field = lfcore.record(scene, folder / "a.mkv", views=4, pixels=32)
        near = field.refocus()
        assert picture.max() > 0.1 and np.abs(near - picture).mean() < 0.05
        command = Path(sys.executable).with_name("lfcore")
        (folder / "ball.yaml").write_text("objects: [{builder: sphere}]\n")
        ball = "render ball.yaml -o b.png --pixels 32"
        for words in ("devices --check", "info a.mkv", "refocus a.mkv -o a.png", ball):
            subprocess.run([command, *words.split()], cwd=folder, check=True)
        assert (folder / "a.png").is_file() and (folder / "b.png").is_file()
    print(f"lfcore {lfcore.__version__} on Python {sys.version.split()[0]}: well")


main()
