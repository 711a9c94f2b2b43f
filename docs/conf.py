"""The documentation's build: `python -m sphinx -W -c docs . site` in a checkout.

The source folder is the checkout, so that notebooks and the pages of `studies` are read where they are, and links
between files hold on the site as they do in the checkout. Pages that are made from the code go to `docs/generated`.
"""

import sys
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS))

import deli  # noqa: E402

project = "deli"
author = "the developers of deli"
version = release = deli.__version__
root_doc = "docs/index"
include_patterns = ["docs/**", "studies/**", "CHANGELOG.md", "CONTRIBUTING.md"]
templates_path = [str(DOCS / "templates")]
exclude_patterns = ["docs/templates", ".*", "**/.ipynb_checkpoints", "site", "build", "dist", "**/site-packages"]

extensions = [
    "myst_nb",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx-mathjax-offline",
    "generate",
]

myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "colon_fence", "attrs_inline"]
myst_heading_anchors = 4
nb_execution_mode = "off"  # their outputs are those of full runs
nb_merge_streams = True

default_role = "py:obj"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autosummary_generate = True
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "furo"
html_title = f"deli {release}"
html_show_sphinx = False
html_static_path = []
copybutton_prompt_text = r"\$ |>>> |\.\.\. "
copybutton_prompt_is_regexp = True
