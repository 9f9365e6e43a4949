"""Pages of the manual that are run: Markdown, which MyST-NB takes as a notebook.

A page with comments of the first kind is run; its blocks of ``bash`` and ``python`` are cells, in
one folder with links to the project's scenes and workflow.

    <!-- run; small: --pixels 256 = --pixels 24 | views=9 = views=3 -->   replacements in tests
    <!-- picture: near.png | caption -->   shows a picture that a cell made
    <!-- viewer: bike.html | caption -->   shows a page that a cell made, in a frame
    <!-- given: model.glb studio.exr -->   files of the reader's, for which small ones are made
"""

import re
import shutil
from pathlib import Path

from nbformat import NotebookNode
from nbformat.v4 import new_code_cell, new_markdown_cell, new_notebook

ROOT = Path(__file__).resolve().parents[2]
MADE = ROOT / "build" / "docs" / "pages"
REACHED = ("Snakefile", "config", "profiles", "scenes", "workflow")
CODE = re.compile(r"^```(bash|python)\n(.*?)\n```$", re.MULTILINE | re.DOTALL)
RUN = re.compile(r"^<!-- run(?:; small: (.*?))? -->\n", re.MULTILINE)
GIVEN = re.compile(r"^<!-- given: (.*?) -->\n", re.MULTILINE)
SHOWN = re.compile(r"^<!-- (picture|viewer): (\S+) \| (.*?) -->$", re.MULTILINE)
BASH = """import subprocess

done = subprocess.run(
    ["bash", "-euo", "pipefail", "-c", {code!r}],
    stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
)
print(done.stdout, end="")
done.check_returncode()"""
"""The cell of a block of bash: its output comes in one piece."""
KERNEL = {"display_name": "Python 3", "language": "python", "name": "python3"}
VIEWER = """import html
from pathlib import Path
from IPython.display import HTML

page = html.escape(Path("{file}").read_text(encoding="utf-8"))
HTML(f"<div><iframe class='viewer' title='{title}' srcdoc='{{page}}'></iframe></div>")"""


def read(text: str, made: Path = MADE, *, small: bool = False) -> NotebookNode:
    """The page as a notebook that runs in a folder below ``made``; ``small`` as tests run it.

    A page that is not run is one cell of Markdown.
    """
    runs = RUN.findall(text)
    if not runs:
        return new_notebook(cells=[new_markdown_cell(text)])
    text = RUN.sub("", text)
    if small:
        for pair in (pair for line in runs for pair in line.split(" | ") if pair):
            whole, tiny = pair.split(" = ")
            assert whole in text, f"{whole!r} is in no block"
            text = text.replace(whole, tiny)
    folder = made / re.sub(r"\W+", "-", text.partition("\n")[0].lower()).strip("-")
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name in REACHED:
        (folder / name).symlink_to(ROOT / name)
    for name in " ".join(GIVEN.findall(text)).split():
        _give(folder / name)
    start = new_code_cell(f"import os\n\nos.chdir({str(folder)!r})")
    start.metadata["tags"] = ["remove-cell"]
    first, *rest = CODE.split(GIVEN.sub("", text))
    cells = [*_shown(first), start]
    for language, code, words in zip(rest[::3], rest[1::3], rest[2::3], strict=True):
        if language == "python":
            cells.append(new_code_cell(code))
        else:
            cells += [new_markdown_cell(f"```bash\n{code}\n```"), _hidden(BASH.format(code=code))]
        cells += _shown(words)
    return new_notebook(cells=cells, metadata={"kernelspec": KERNEL})


def _give(path: Path) -> None:
    """Make a small file in place of the reader's: a mesh, or a panorama."""
    if path.suffix == ".exr":
        import numpy as np

        from lfcore import write_picture

        write_picture(path, np.linspace(1.0, 0.1, 16 * 32 * 3, dtype="f4").reshape(16, 32, 3))
    else:
        import trimesh

        shape = trimesh.creation.box if path.suffix == ".obj" else trimesh.creation.icosphere
        shape().export(path)


def _hidden(code: str, alt: str = "") -> NotebookNode:
    """A cell whose output alone is on the page."""
    cell = new_code_cell(code)
    cell.metadata = {"tags": ["remove-input"], "mystnb": {"image": {"alt": alt}}}
    return cell


def _shown(words: str) -> list[NotebookNode]:
    """Cells of the text between blocks, with its pictures and viewers."""
    first, *rest = SHOWN.split(words)
    cells = [new_markdown_cell(first.strip())]
    for kind, file, caption, words in zip(*(rest[k::4] for k in range(4)), strict=True):
        code = f'from IPython.display import Image\n\nImage("{file}")'
        if kind == "viewer":
            code = VIEWER.format(file=file, title=caption)
        cells += [_hidden(code, caption), new_markdown_cell(f"*{caption}*\n\n{words.strip()}")]
    return [cell for cell in cells if cell.source]
