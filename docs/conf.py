"""How these pages become a site: ``pip install '.[docs]' && sphinx-build -W docs site``.

Everything that a page needs is in the site itself: no font, script or picture comes from another
server, and it can be read and searched from disk. Reference pages are written before each build, by
``tools/write_reference.py``, from the settings of the commands and the public names of the package.
"""

import re
import sys
from pathlib import Path

from docutils.nodes import Text
from sphinx.addnodes import desc_annotation, desc_parameter

_ROOT = Path(__file__).parents[1]
sys.path[:0] = [str(_ROOT), str(_ROOT / "tools")]

from rift_cl import __version__  # noqa: E402
from write_reference import write_reference  # noqa: E402

project = "RiFT-CL"
author = "The RiFT-CL authors"
project_copyright = author
version = release = __version__
root_doc = "index"
exclude_patterns = ["_build"]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]

# Links to headings, as they are on other pages of the repository.
myst_heading_anchors = 4
myst_enable_extensions = ["deflist"]
# Blocks that are indented are commands, not Python.
highlight_language = "none"
autodoc_typehints = "signature"
autodoc_member_order = "bysource"
napoleon_numpy_docstring = False

# Settings of one name belong to several commands; a type of that name is none of them.
suppress_warnings = ["ref.python"]

html_theme = "furo"
html_title = f"RiFT-CL {version}"
html_static_path = ["site.css"]
html_css_files = ["site.css"]
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"navigation_with_keys": True, "top_of_page_buttons": []}

write_reference(Path(__file__).parent / "reference" / "generated")


# Types of signatures as Python spells them out, and as the source does.
_TYPES = (
    (r"~?[\w.]*_Buffer \| .*?_NestedSequence\[~?[\w.]*complex \| .*?\]", "ArrayLike"),
    (r"type\[~?[\w.]*Any\] \| ~?[\w.]*dtype\[~?[\w.]*Any\] \| .*?_DTypeDict \| str", "DTypeLike"),
    (r"~?[\w.]*ndarray\[tuple\[~?[\w.]*Any, \.\.\.\], ~?[\w.]*dtype\[(.*?)\]\]", r"NDArray[\1]"),
    # Defaults that are no Python: a signature with one would be shown as it is written here.
    (r"<factory>", "..."),
    (r"<class '[\w.]*?(\w+)'>", r"\1"),
)


def _plain(types):
    """Types of a signature without the marks that the command line reads."""
    for long, short in _TYPES:
        types = re.sub(long, short, types)
    while marked := re.search(r"~?(?:typing\.)?Annotated\[", types):
        depth, first, at = 0, None, marked.end()
        while depth >= 0:
            depth += {"[": 1, "(": 1, "]": -1, ")": -1}.get(types[at], 0)
            if types[at] == "," and depth == 0 and first is None:
                first = types[marked.end() : at]
            at += 1
        types = types[: marked.start()] + first + types[at:]
    return types


def setup(app):
    """Bars are absolute values in our docstrings, and substitutions to Sphinx."""

    def shorten_types(app, what, name, of, options, signature, returns):
        return signature and _plain(signature), returns and _plain(returns)

    def escape_bars(app, what, name, of, options, lines):
        lines[:] = [re.sub(r"(``.*?``)|[|]", lambda m: m[1] or r"\|", line) for line in lines]

    def shorten_others(app, doctree):
        """Types of attributes and of overloads, of which autodoc tells no one."""
        for kind in (desc_annotation, desc_parameter):
            for node in doctree.findall(kind):
                plain = _plain(node.astext())
                if plain != node.astext():
                    node[:] = [Text(plain)]

    app.connect("doctree-read", shorten_others)
    app.connect("autodoc-process-docstring", escape_bars)
    app.connect("autodoc-process-signature", shorten_types)
