"""The lists of pages are whole, and what the site adds to the pages is what is in the code. `make site` builds it."""

import importlib
import json
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from insert import PAGES, ROOT

import faultbond

DOCS, DECISIONS, EXAMPLES = ROOT / "docs", ROOT / "docs" / "decisions", ROOT / "examples"
LISTS = {DOCS: [*DOCS.glob("*.md"), *DOCS.glob("notebooks/*.ipynb")], DECISIONS: [*DECISIONS.glob("*.md")]}
LISTS |= {EXAMPLES: [*EXAMPLES.glob("*/README.md")]}


@pytest.fixture
def site(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Load a module of the site's folder, by its name."""
    monkeypatch.syspath_prepend(str(DOCS / "site"))
    for name in ("cells", "names"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    return importlib.import_module


def listed(page: Path) -> dict[Path, str]:
    """Give what the items of a page's lists link to, by file, with the words of the links."""
    found = re.findall(r"^- \[([^\]]+)\]\((?!https?:)([^)#]+)\)", page.read_text(encoding="utf-8"), flags=re.M)
    return {(page.parent / target).resolve(): title for title, target in found}


@pytest.mark.parametrize("folder", LISTS, ids=lambda folder: folder.name)
def test_every_page_is_listed(folder: Path) -> None:
    """The page that lists a folder lists each of its pages, in a list whose items begin with the link."""
    found = listed(folder / "README.md")
    assert [path.name for path in LISTS[folder] if path not in found and path != folder / "README.md"] == []
    assert [str(path) for path in found if not path.is_file()] == []


def test_all_pages_can_be_reached() -> None:
    """From the list of all pages one comes to each page of the project by lists alone."""
    reached = {ROOT / "README.md", DOCS / "README.md"}
    for page in (DOCS / "README.md", DECISIONS / "README.md", EXAMPLES / "README.md"):
        reached |= set(listed(page))
    assert [str(path) for path in PAGES if path not in reached] == []


def test_decisions_are_listed_by_their_titles() -> None:
    """The list of decisions has their titles, in order."""
    found = listed(DECISIONS / "README.md")
    titles = {path: path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ") for path in found}
    assert found == titles
    assert list(found) == sorted(found)


def test_every_example_is_listed() -> None:
    """Each folder of examples is in their list."""
    text = (EXAMPLES / "README.md").read_text(encoding="utf-8")
    folders = sorted(path.name for path in EXAMPLES.iterdir() if path.is_dir())
    assert [name for name in folders if f"]({name}/" not in text] == []


def test_the_reference_has_the_public_names(site: Any) -> None:
    """The reference has each public name once, under what it is."""
    text = site("names").names_as_text()
    assert sorted(re.findall(r"^\.\. auto\w+:: faultbond\.(\w+)$", text, flags=re.M)) == sorted(faultbond.__all__)
    errors = text.partition("## Errors")[2].partition("\n## ")[0]
    assert "autoexception:: faultbond.ModelError" in errors


def test_docstrings_become_markup(site: Any) -> None:
    """Sections get headings, names get entries, and stars, bars and underlines are taken as they are."""
    lines = ["Give K*x of `a b`.", "", "Parameters", "----------", "x, y : of n_u", "    more", "z : |z|", ""]
    lines += ["Raises", "------", "ModelError", "    Where not.", "", "Example", "-------", ">>> f(*x_)", "2 * 3"]
    site("names").rewritten(None, "function", "f", None, None, lines)
    text = "\n".join(lines)
    assert "Give K\\*x of ``a b``." in text
    assert "``x, y``\n    of n\\_u\n    more\n\n``z``\n    \\|z\\|" in text
    assert [f".. rubric:: {name}" in text for name in ("Parameters", "Raises", "Example")] == [True] * 3
    assert "ModelError\n    Where not." in text
    assert ">>> f(*x_)\n2 * 3" in text


def test_notebooks_become_pages(site: Any) -> None:
    """Of a notebook the text, the code and what it printed are shown, the latter in its richest form."""
    shown = {
        "output_type": "display_data",
        "data": {"text/plain": "table", "text/html": ["<b>1</b>\n", "\n", "<i>2</i>"]},
    }
    printed = {"output_type": "stream", "text": ["1\n", "2\n"]}
    cells = [
        {"cell_type": "markdown", "source": ["# Title\n", "Text."]},
        {"cell_type": "code", "source": "print(1)", "outputs": [printed, shown]},
    ]
    text = site("cells").as_markdown(json.dumps({"cells": cells}))
    assert text.startswith("# Title\nText.\n\n````python\nprint(1)\n````\n\n````text\n1\n2\n````\n\n")
    assert text.endswith('<div class="output">\n<b>1</b>\n<i>2</i>\n</div>\n')
