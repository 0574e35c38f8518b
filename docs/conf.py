"""Configuration of the documentation: `python -m sphinx -W docs docs/_build`."""

from __future__ import annotations

import sys
from pathlib import Path

DOCS = Path(__file__).resolve().parent
sys.path[:0] = [str(DOCS.parent), str(DOCS / "ext")]

from rope_twin import __version__  # noqa: E402

project = "rope_twin"
author = "the rope_twin maintainers"
project_copyright = "2026, the rope_twin maintainers. BSD-3-Clause"
version = release = __version__

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated", "mathml"]
html_math_renderer = "mathml"
exclude_patterns = ["_build", "ext", "validation", "**.ipynb_checkpoints"]
nb_execution_mode = "off"  # test/docs runs the notebook; here its stored output is shown
myst_enable_extensions = ["amsmath", "colon_fence", "deflist", "dollarmath"]
myst_heading_anchors = 3
math_number_all = False
math_eqref_format = "({number})"
numfig = True

nitpicky = True
nitpick_ignore_regex = [("py:.*", ".*")]  # annotations of private classes have no page to link to
autodoc_typehints = "none"
autodoc_member_order = "groupwise"
smartquotes = False  # `--duration` is an option
default_role = "code"  # docstrings mark code by single backticks

html_theme = "furo"
html_title = f"rope_twin {__version__}"
html_static_path = ["static"]
html_css_files = ["tables.css"]
html_theme_options = {"navigation_with_keys": True}
