"""Sphinx configuration; the examples in docs/examples/plot_*.py are executed at every build."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parent), str(HERE)]  # the pipelines, which the wheel leaves out, and `reference`

import catalogue
import reference

reference.write()
catalogue.draw(HERE / "api" / "curves")

project = "whsklearn"
author = "The whsklearn developers"
copyright = "2026, The whsklearn developers"
release = version = installed_version("whsklearn")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
default_role = "py:obj"  # a name between single backticks leads to its page, if it has one
smartquotes = False  # it would turn the two hyphens of an option into a dash
exclude_patterns = ["_build", "examples", "auto_examples/*.ipynb"]
myst_enable_extensions = ["deflist", "colon_fence"]
myst_heading_anchors = 3

autosummary_generate = True
toc_object_entries_show_parents = "hide"  # the class stands above its methods anyway
autodoc_typehints = "none"  # numpydoc sections say it in words
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
templates_path = ["_templates"]

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "auto_examples",
    "filename_pattern": r"plot_",
    "abort_on_example_error": True,
    "within_subsection_order": "FileNameSortKey",
    "download_all_examples": False,
    "remove_config_comments": True,
    "show_memory": False,
    "min_reported_time": 30,
    "capture_repr": ("_repr_html_",),  # tables; the names of axes and legends tell nobody anything
    "reset_modules": ("matplotlib", "catalogue.forget_own"),
    "reset_modules_order": "both",
}

suppress_warnings = ["ref.ref"]  # docstrings inherited from scikit-learn refer to its own user guide

html_theme = "pydata_sphinx_theme"
html_title = "whsklearn"
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["wide.css"]
html_sidebars = {"**": []}  # the room is for code, tables and pictures; the header leads to the sections
html_theme_options = {
    "navigation_with_keys": False,
    "show_toc_level": 2,
    "secondary_sidebar_items": ["page-toc"],
    "header_links_before_dropdown": 7,
}


def escape_bars(app, what, name, obj, options, lines):
    """|x| is a magnitude in our docstrings, and a substitution in reStructuredText: say which."""
    example = False
    for i, line in enumerate(lines):
        example = line.lstrip().startswith(">>>") or (example and bool(line.strip()))
        if not example:
            parts = line.split("``")  # every second one is literal
            parts[::2] = [p.replace("|", r"\|") for p in parts[::2]]
            lines[i] = "``".join(parts)


def skip_generated(app, what, name, obj, skip, options):
    """Leave out what scikit-learn writes into every estimator, and what a tuple brings along."""
    routing = name == "get_metadata_routing" or (name.startswith("set_") and name.endswith("_request"))
    alias = str(getattr(obj, "__doc__", "")).startswith("Alias for field number")
    return True if routing or alias else skip


def setup(app):
    """Ours before numpydoc, which makes its own tables of the lines, and the bars after it."""
    app.connect("autodoc-process-docstring", catalogue.describe, priority=100)
    app.connect("autodoc-process-docstring", escape_bars, priority=900)
    app.connect("autodoc-skip-member", skip_generated)
