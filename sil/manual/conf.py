# SPDX-License-Identifier: MIT
# Copyright (c) 2026 the penode authors
"""Sphinx's settings for `make site`; assemble.py lays out the pages, and passes the version."""

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

project = "penode"
author = "the penode authors"
project_copyright = "2026 the penode authors"

extensions = ["myst_parser"]
root_doc = "sil/manual/index"
exclude_patterns: list[str] = []
myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]
suppress_warnings = ["myst.header"]  # pages of a repository may begin below the first level
highlight_language = "none"

html_theme = "furo"
html_title = "penode"
html_show_sourcelink = False
html_copy_source = False
html_static_path = ["_static"]
html_extra_path = ["_extra"]
html_css_files = ["manual.css"]
html_theme_options = {"navigation_with_keys": True}


def setup(app: Sphinx) -> None:
    """Fences of languages that Pygments does not have."""
    app.add_lexer("ld", TextLexer)
