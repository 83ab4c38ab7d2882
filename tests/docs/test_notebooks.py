"""The notebooks run from their first cell to the last, in an empty folder, and are kept without output."""

import ast
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from insert import ROOT

NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))


def cells(path: Path, kind: str) -> Iterator[dict[str, Any]]:
    """Give the cells of a kind."""
    yield from (item for item in json.loads(path.read_text(encoding="utf-8"))["cells"] if item["cell_type"] == kind)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run(path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each cell runs after those before it, and what its last line gives can be shown."""
    pyplot = pytest.importorskip("matplotlib.pyplot")
    monkeypatch.chdir(tmp_path)
    pyplot.switch_backend("agg")
    names: dict[str, Any] = {}
    for number, cell in enumerate(cells(path, "code"), start=1):
        tree = ast.parse("".join(cell["source"]), filename=f"{path.name}, cell {number}")
        last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
        exec(compile(tree, path.name, "exec"), names)  # noqa: S102 - our own notebooks
        if isinstance(last, ast.Expr):
            shown = eval(compile(ast.Expression(last.value), path.name, "eval"), names)  # noqa: S307 - as above
            html = getattr(shown, "_repr_html_", lambda: None)()
            assert html or repr(shown)
            if type(shown).__module__.startswith("faultbond."):
                assert html
    pyplot.close("all")


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_are_kept_without_output(path: Path) -> None:
    """A notebook has a title, words between its cells, and nothing that a run leaves."""
    assert next(cells(path, "markdown"))["source"][0].startswith("# ")
    assert [cell["id"] for cell in cells(path, "code") if cell["outputs"] or cell["execution_count"]] == []


def test_there_are_notebooks() -> None:
    """The page names each of them."""
    page = (ROOT / "docs" / "python.md").read_text(encoding="utf-8")
    assert NOTEBOOKS
    assert [path.name for path in NOTEBOOKS if f"notebooks/{path.name}" not in page] == []
