"""How Sphinx builds these pages: ``make docs``; any warning, a broken link among them, is an error there."""

import snarelab

project = "snarelab"
version = release = snarelab.__version__
copyright = "the authors of snarelab, Apache License 2.0"

extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
source_suffix = {".md": "myst-nb", ".ipynb": "myst-nb"}
nb_execution_mode = "off"  # what run_notebooks.py stored is shown; a test runs them
root_doc = "index"
exclude_patterns = ["make_*.py", "run_notebooks.py"]

myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence"]

autodoc_typehints = "none"  # types stand in the signatures, their meaning in the docstrings
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
nitpicky = False

# Nothing on a page is fetched from elsewhere: fonts are the reader's own, search runs in the page.
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_js_files = ["scrolling.js"]
html_title = f"snarelab {version}"
html_copy_source = False
html_show_sphinx = False
templates_path: list[str] = []
html_theme_options = {"navigation_with_keys": True}


def levelled(app, page, template, context, doctree):
    """Captions of the menu are headings; a screen reader wants to hear of which level."""
    for part in ("body", "furo_navigation_tree", "toctree"):
        if isinstance(context.get(part), str):
            context[part] = context[part].replace('role="heading">', 'role="heading" aria-level="2">')


def setup(app):
    """After the theme has made its menu."""
    app.connect("html-page-context", levelled, priority=900)
