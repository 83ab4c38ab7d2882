"""Docstrings: every public thing has one, and the arguments that it lists are those of the signature."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[1] / "src" / "faultbond"
MODULES = sorted(SOURCE.rglob("*.py"))

Function = ast.FunctionDef | ast.AsyncFunctionDef


def name_of(path: Path) -> str:
    """Give the path below src/faultbond, the name of a test case."""
    return path.relative_to(SOURCE).as_posix()


def public(body: list[ast.stmt], prefix: str = "") -> Iterator[tuple[str, Function | ast.ClassDef]]:
    """Give (dotted name, node) of the public functions and classes, methods included."""
    for node in body:
        if isinstance(node, Function | ast.ClassDef) and not node.name.startswith("_"):
            yield prefix + node.name, node
            if isinstance(node, ast.ClassDef):
                yield from public(node.body, f"{prefix}{node.name}.")


def signature(function: Function) -> list[str]:
    """Give the argument names of a function in order, without self and cls."""
    arguments = function.args
    names = [item.arg for item in (*arguments.posonlyargs, *arguments.args)]
    names += [arguments.vararg.arg] if arguments.vararg else []
    names += [item.arg for item in arguments.kwonlyargs]
    return [name for name in names if name not in ("self", "cls")]


def listed(docstring: str) -> list[str] | None:
    """Give the names in the Parameters section of a numpy docstring; None without such a section."""
    match = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n---|\Z)", docstring, flags=re.M | re.S)
    if match is None:
        return None
    entries = [line for line in match[1].splitlines() if line and not line[0].isspace()]
    return [name.strip().lstrip("*") for line in entries for name in line.partition(" : ")[0].split(",")]


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_public_things_have_docstrings(path: Path) -> None:
    """A module, public class, function or method says what it is for."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    assert ast.get_docstring(tree), "module"
    assert [name for name, node in public(tree.body) if not ast.get_docstring(node)] == []


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_parameters_match_the_signature(path: Path) -> None:
    """A Parameters section lists the arguments of its function, all of them and in order."""
    for name, node in public(ast.parse(path.read_text(encoding="utf-8")).body):
        names = listed(ast.get_docstring(node) or "")
        if names is not None and isinstance(node, Function):
            assert names == signature(node), name


def test_the_reader_of_sections() -> None:
    """Names are read from a section with shared lines, indented text and a section after it."""
    docstring = "Do.\n\nParameters\n----------\nx, u : array\n    SI : yes\ny : float\n\nReturns\n-------\nz : float\n"
    assert listed(docstring) == ["x", "u", "y"]
    assert listed("Do.") is None
