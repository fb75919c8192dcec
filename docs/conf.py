"""Sphinx settings. Everything a page needs is made at build time; nothing is loaded from afar."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "_ext"))

import dnacheck  # noqa: E402

project = "dnacheck"
author = "dnacheck developers"
copyright = "dnacheck developers, MIT licence"
version = release = dnacheck.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "mathtext",
    "command_help",
    "api_pages",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["_build", "_ext"]
myst_enable_extensions = ["dollarmath", "deflist", "fieldlist", "colon_fence"]
myst_heading_anchors = 3
html_math_renderer = "mathtext"

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
napoleon_numpy_docstring = True
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

# Attributes called "name" or "target" exist on many classes; the text says which is meant.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"dnacheck {release}"
html_static_path = ["_static"]
html_css_files = ["dnacheck.css"]
html_show_sphinx = False
html_copy_source = False
pygments_style = "friendly"
pygments_dark_style = "native"
