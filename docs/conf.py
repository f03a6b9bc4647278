"""Configuration of the book; `docs/build` builds it."""

project = "hydroid"
author = "the hydroid authors"
copyright = author
extensions = ["myst_parser", "sphinx.ext.mathjax"]
exclude_patterns = ["_static"]
html_theme = "furo"
html_title = "hydroid"
html_copy_source = False
html_show_sphinx = False
html_static_path = ["_static"]
# `docs/build` puts the script there, so that the book needs no network.
mathjax_path = "tex-svg-full.js"
# `$x$`, `$$x$$`, and headings as link targets, as code hosts name them.
myst_enable_extensions = ["amsmath", "dollarmath"]
myst_heading_anchors = 4
nitpicky = True
