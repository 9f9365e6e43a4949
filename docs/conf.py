"""The manual's site: `make docs` writes build/docs/html, which is read from disk."""

import os
import re
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import lfcore
from docs.site.reference import with_docstrings

# Pages that are run take this environment's commands.
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"

project = "lfcore"
author = "the authors of lfcore"
copyright = author
version = release = lfcore.__version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "numpydoc"]
nb_custom_formats = {".md": "docs.site.pages.read"}
nb_execution_timeout = 1800
nb_execution_raise_on_error = True
nb_merge_streams = True
numpydoc_show_class_members = False
autosummary_generate = False
exclude_patterns = ["site", "examples", "pictures"]
myst_enable_extensions = ["deflist", "attrs_inline"]
myst_heading_anchors = 3
# Two hyphens before an option are two hyphens.
smartquotes = False
nitpicky = False
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
maximum_signature_line_length = 88
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = f"lfcore {release}"
html_static_path = ["site/static"]
html_css_files = ["manual.css"]
html_show_sphinx = False
html_copy_source = False

# Files outside docs/; the site has a page that includes each.
ELSEWHERE = {
    "scenes/README": "scenes", "config/README": "configuration", "benchmarks/README": "benchmarks",
    "README": "index", "CONTRIBUTING": "architecture",
}  # fmt: skip
OUTSIDE = re.compile(rf"\((?:\.\./)+({'|'.join(ELSEWHERE)})\.md(?:#[\w-]+)?\)")


def setup(app) -> None:
    def mend(app, document: str, source: list[str]) -> None:
        if document == "api":
            source[0] = with_docstrings(source[0])
        source[0] = OUTSIDE.sub(lambda found: f"(/{ELSEWHERE[found[1]]}.md)", source[0])

    app.connect("source-read", mend)
