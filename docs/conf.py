"""The manual's site: `make docs` writes build/docs/html, which is read from disk."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import lfcore

project = "lfcore"
author = "the authors of lfcore"
copyright = author
version = release = lfcore.__version__

extensions = [
    "myst_parser", "sphinx.ext.autodoc", "numpydoc", "sphinxarg.ext", "docs.site.extension",
]  # fmt: skip
numpydoc_show_class_members = False
autosummary_generate = False
source_suffix = {".md": "markdown"}
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
