"""How Sphinx builds the manual: `make docs`. Nothing is fetched while it builds."""

import re
import sys
from pathlib import Path

from docutils.nodes import Element
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment
from sphinx.util.inspect import TypeAliasForwardRef

import palpate

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

project = "palpate"
author = "The palpate developers"
version = release = palpate.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "generated_pages"]
exclude_patterns = ["_build"]
myst_heading_anchors = 3
suppress_warnings = [
    # Code in our own languages (seg, bml, ebnf variants) that Pygments does not colour.
    "misc.highlighting_failure",
]

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
autodoc_type_aliases = {
    "Float64Array": "Float64Array",
    "IndexArray": "IndexArray",
    "npt.ArrayLike": "ArrayLike",
}
TypeAliasForwardRef.__repr__ = lambda self: self.name  # within dict[...] and unions
napoleon_google_docstring = False
napoleon_use_ivar = True
default_role = "any"

html_theme = "furo"
html_title = f"palpate {version}"
html_show_copyright = False
html_copy_source = False
html_static_path = ["_static"]
html_css_files = ["palpate.css"]
html_theme_options = {"navigation_with_keys": True}

#: A link to a file of the repository that is not part of the manual; pictures are.
_LINK_OUTSIDE = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+)([^)]+)\)")


def _name_files(_app: Sphinx, page: str, source: list[str]) -> None:
    """Links to files outside docs/ become their names, as nothing is there in the manual."""
    outside = "../" * (page.count("/") + 1)

    def name(found: re.Match[str]) -> str:
        return f"{found[1]} (`{found[3]}`)" if found[2] == outside else found[0]

    source[0] = _LINK_OUTSIDE.sub(name, source[0])


def _as_it_is(_app: Sphinx, _env: BuildEnvironment, node: Element, text: Element) -> Element | None:
    """What stands between backticks in a docstring and is no name of ours, as it is."""
    return text if node.get("reftype") == "any" else None


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    app.connect("missing-reference", _as_it_is)
    app.connect("source-read", _name_files)
