"""How the pages in this folder become a site: ``make docs``."""

project = "mocapidx"
author = "the mocapidx authors"
extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.napoleon",
    "sphinx_click",
]
html_theme = "furo"
html_title = "mocapidx"
html_show_sphinx = False
html_show_copyright = False
smartquotes = False  # two dashes begin an option
exclude_patterns = ["pictures"]
templates_path = ["_templates"]
myst_heading_anchors = 3
autodoc_typehints = "none"  # the docstrings tell types with shapes and units
napoleon_use_rtype = False
suppress_warnings = [
    "myst.xref_missing",  # links to files of the source tree are for readers of the tree
    "ref.footnote",  # docstrings list their papers without referring to each
]


def setup(app):
    """Show the examples of commands as they are typed."""
    app.connect("sphinx-click-process-description", as_typed)


def as_typed(app, context, lines):
    """Make literal blocks of the lines that click keeps apart; no text is a mail address."""
    shown = []
    for line in lines:
        typed = line.startswith("| ")
        if typed and not (shown and shown[-1].startswith("   ")):
            shown += ["::", ""]
        shown.append(f"   {line[2:]}" if typed else line.replace("@", "\\@"))
    lines[:] = shown
