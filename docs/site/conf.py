"""The site: the pages as they are, with a reference of the public Python names. `make site` builds it.

The pages are plain Markdown that reads well without the site. What the site adds is worked out here: the navigation is
what the lists of links in `docs/README.md` and in `README.md` of other folders say, and the page of Python names gets
what is in `faultbond.__all__`.
"""

import re
import shutil
import sys
from pathlib import Path

from docutils import nodes
from myst_parser.parsers.sphinx_ import MystParser
from sphinx.application import Sphinx
from sphinx.errors import SphinxError

SITE = Path(__file__).parent
ROOT = SITE.parents[1]
sys.path[:0] = [str(SITE), str(ROOT / "src")]

from cells import as_markdown  # noqa: E402 - beside this file
from names import names_as_text, rewritten  # noqa: E402

project = "faultbond"
author = "The faultbond maintainers"
project_copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.viewcode"]
root_doc = "README"
source_suffix = {".md": "markdown", ".ipynb": "notebook"}
include_patterns = [
    "*.md",
    "docs/*.md",
    "docs/decisions/*.md",
    "docs/notebooks/*.ipynb",
    "examples/README.md",
    "examples/*/README.md",
]
exclude_patterns = ["build", "dist", ".*", "src", "tests", "benchmarks"]

myst_heading_anchors = 6  # made as GitHub makes them, so that links lead to the same place on both
suppress_warnings = ["misc.highlighting_failure", "myst.header"]
default_role = "literal"
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
python_maximum_signature_line_length = 80
toc_object_entries_show_parents = "hide"

html_theme = "furo"
html_title = "faultbond"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_favicon = "static/icon.svg"
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
templates_path: list[str] = []
pygments_style, pygments_dark_style = "friendly", "native"
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#0b5394", "color-brand-content": "#0b5394"},
    "dark_css_variables": {"color-brand-primary": "#7fb8ee", "color-brand-content": "#7fb8ee"},
    "navigation_with_keys": True,
}

INDEX, NAMES = "docs/README", "docs/reference"
LISTS = ("docs/decisions/README", "examples/README")  # pages whose links become entries below theirs
LINK = re.compile(r"^- \[([^\]]+)\]\((?!https?:)([^)#]+)\.(?:md|ipynb)\)", flags=re.M)
LOADING = (".html", ".css")
OUTSIDE = re.compile(
    r'(?:<(?:script|img|iframe|source)\b[^>]*\ssrc=|<link\b[^>]*\shref=|url\()["\']?(?:https?:)?//[^"\')> ]+'
)
TREE = "\n```{{toctree}}\n:hidden:\n:caption: {caption}\n\n{entries}\n```\n"


def entries(text: str, page: str) -> str:
    """Give what the items of the lists of a page link to, as entries of a navigation."""
    place = ROOT / f"{page}.md"
    found = [(title, (place.parent / target).resolve().relative_to(ROOT)) for title, target in LINK.findall(text)]
    return "\n".join(f"{title} </{target.as_posix()}>" for title, target in found)


def navigation() -> str:
    """Give the navigation of the site: a part for each heading of the page that lists all pages."""
    _, *parts = re.split(r"^## ", (ROOT / f"{INDEX}.md").read_text(encoding="utf-8"), flags=re.M)
    trees = [TREE.format(caption=part.splitlines()[0], entries=entries(part, INDEX)) for part in parts]
    return "".join([*trees, TREE.format(caption="All pages", entries=f"All pages </{INDEX}>")])


def complete(_: Sphinx, page: str, source: list[str]) -> None:
    """Add to a page what only the site has."""
    if page == root_doc:
        source[0] += navigation()
    elif page in LISTS:
        source[0] += TREE.format(caption="", entries=entries(source[0], page)).replace(":caption: \n", "")
    elif page == NAMES:
        source[0] += names_as_text()


def finished(app: Sphinx, problem: Exception | None) -> None:
    """Let the folder of the site open with its first page, and refuse pages that would ask another host for something.

    Raises
    ------
    SphinxError
        Where a page would load something from another host.
    """
    if problem is None:
        folder = Path(app.outdir)
        shutil.copyfile(folder / f"{root_doc}.html", folder / "index.html")
        texts = ((path, path.read_text(encoding="utf-8")) for path in folder.rglob("*") if path.suffix in LOADING)
        found = [f"{path.relative_to(folder)}: {match[0]}" for path, text in texts for match in OUTSIDE.finditer(text)]
        if found:
            raise SphinxError(f"what is loaded from another host: {'; '.join(found)}")


class NotebookParser(MystParser):  # type: ignore[misc, unused-ignore]  # where the site is not built it is not installed
    """Reads a notebook as the Markdown that it stands for."""

    supported = ("notebook",)

    def parse(self, inputstring: str, document: nodes.document) -> None:
        """Read the text of a file."""
        super().parse(as_markdown(inputstring), document)


def setup(app: Sphinx) -> None:
    """Take part in the build."""
    app.add_source_parser(NotebookParser)
    app.connect("source-read", complete)
    app.connect("autodoc-process-docstring", rewritten)
    app.connect("build-finished", finished)
