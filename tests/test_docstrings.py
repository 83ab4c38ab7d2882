"""Docstrings: every public thing has one, true to its signature, to what it raises, and to what its examples give."""

import ast
import doctest
import re
import sys
from collections.abc import Iterable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

from imports import MODULES, name_of, tree_of

Function = ast.FunctionDef | ast.AsyncFunctionDef

SECTION = r"^{}\n-+\n(.*?)(?=^\w[^\n]*\n---|\Z)"  # of a numpy docstring, up to the next one
ARRAYS = {"FloatArray", "BoolArray", "IntArray", "NDArray", "ndarray"}
# "(n_states,)", "(2, n_outputs)", "(..., n + 1)", "()": sizes with commas between, one of them with a comma behind.
SIZE = r"(?:\.\.\.|\*?\w+(?: ?[-+*/] ?\w+)*)"
SHAPE = re.compile(rf"(?<!\w)\((?:{SIZE}(?:,\s*{SIZE})+,?|{SIZE},|)\)")
NOT_TOLD = {"AssertionError", "NotImplementedError"}  # they tell of a mistake in the code, not of one by who calls it


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
    lines = entries(docstring, "Parameters")
    if lines is None:
        return None
    return [name.strip().lstrip("*") for line in lines for name in line.partition(" : ")[0].split(",")]


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_public_things_have_docstrings(path: Path) -> None:
    """A module, public class, function or method says what it is for."""
    tree = tree_of(path)
    assert ast.get_docstring(tree), "module"
    assert [name for name, node in public(tree.body) if not ast.get_docstring(node)] == []


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_parameters_match_the_signature(path: Path) -> None:
    """A Parameters section lists the arguments of its function, all of them and in order."""
    for name, node in public(tree_of(path).body):
        names = listed(ast.get_docstring(node) or "")
        if names is not None and isinstance(node, Function):
            assert names == signature(node), name


def test_the_reader_of_sections() -> None:
    """Names are read from a section with shared lines, indented text and a section after it."""
    docstring = "Do.\n\nParameters\n----------\nx, u : array\n    SI : yes\ny : float\n\nReturns\n-------\nz : float\n"
    assert listed(docstring) == ["x", "u", "y"]
    assert listed("Do.") is None


def entries(docstring: str, section: str) -> list[str] | None:
    """Give the lines that are not indented of a section of a docstring; None without that section."""
    match = re.search(SECTION.format(section), docstring, flags=re.M | re.S)
    return match and [line for line in match[1].splitlines() if line and not line[0].isspace()]


def names_raised(docstring: str) -> set[str]:
    """Give the exceptions in the Raises section."""
    return {name for line in entries(docstring, "Raises") or () for name in re.split(r"[,:\s]+", line) if name}


def raised(function: Function, makers: dict[str, str], tuples: dict[str, set[str]]) -> set[str]:
    """Give what leaves a function by raise statements of its own; what it caught and raises again is not its own."""
    return {name for name in leaving(function.body, makers, tuples) if name[:1].isupper()} - NOT_TOLD


def leaving(nodes: Iterable[ast.AST], makers: dict[str, str], tuples: dict[str, set[str]]) -> set[str]:
    """Give the names of what raise statements below some nodes raise and no handler there keeps."""
    found = set()
    for node in nodes:
        match node:
            case ast.FunctionDef() | ast.AsyncFunctionDef() | ast.Lambda() | ast.ClassDef():
                continue
            case ast.Raise(exc=ast.Call(func=made)) | ast.Raise(exc=made) if made is not None:
                name = made.attr if isinstance(made, ast.Attribute) else made.id if isinstance(made, ast.Name) else ""
                found |= {makers.get(name, name)}
            case ast.Try():
                found |= leaving(node.body, makers, tuples) - kept(node.handlers, tuples)
                found |= leaving([*node.handlers, *node.orelse, *node.finalbody], makers, tuples)
            case _:
                found |= leaving(ast.iter_child_nodes(node), makers, tuples)
    return found


def kept(handlers: list[ast.ExceptHandler], tuples: dict[str, set[str]]) -> set[str]:
    """Give the exceptions that handlers catch by name, and do not raise again."""
    found = set[str]()
    for handler in handlers:
        again = {None, handler.name}
        raises = [item.exc for node in handler.body for item in ast.walk(node) if isinstance(item, ast.Raise)]
        if handler.type and not any((exc.id if isinstance(exc, ast.Name) else exc) in again for exc in raises):
            names = {item.id for item in ast.walk(handler.type) if isinstance(item, ast.Name)}
            found |= set[str]().union(*(tuples.get(name, {name}) for name in names))
    return found


@cache
def makers() -> dict[str, str]:
    """Give the functions of the package that give an exception, and which."""
    found = {}
    for path in MODULES:
        for node in ast.walk(tree_of(path)):
            if isinstance(node, Function) and node.returns is not None:
                result = ast.unparse(node.returns)
                if result.endswith("Error"):
                    found[node.name] = result
    return found


def tuples(tree: ast.Module) -> dict[str, set[str]]:
    """Give the tuples of names that a module names, such as the exceptions that it catches together."""
    return {
        ast.unparse(node.targets[0]): {item.id for item in node.value.elts if isinstance(item, ast.Name)}
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Tuple)
    }


@cache
def exceptions() -> set[str]:
    """Give the names of all exceptions: those of Python and of what is used of its library and of fastapi, and ours."""
    nodes = [node for path in MODULES for node in ast.walk(tree_of(path))]
    imported = {alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names}
    imported |= {node.module for node in nodes if isinstance(node, ast.ImportFrom) and node.module}
    known = {
        name
        for module in {"builtins", *imported & (sys.stdlib_module_names | {"fastapi"})}
        for name, item in vars(import_module(module)).items()
        if isinstance(item, type) and issubclass(item, BaseException)
    }
    classes = [node for node in nodes if isinstance(node, ast.ClassDef)]
    while more := {node.name for node in classes if known & {ast.unparse(base) for base in node.bases}} - known:
        known |= more
    return known


def has_array(annotation: ast.AST | None) -> bool:
    """Whether an annotation speaks of an array; those in a table by name have a shape each."""
    match annotation:
        case None | ast.Subscript(value=ast.Name(id="dict" | "Mapping")):
            return False
        case ast.Name(id=name) | ast.Attribute(attr=name):
            return name in ARRAYS
        case ast.Constant(value=str() as text):
            return has_array(ast.parse(text, mode="eval"))
    return any(map(has_array, ast.iter_child_nodes(annotation)))


def shapeless(path: Path) -> list[str]:
    """Give the public functions with arrays in the signature, and the fields that are arrays, without a shape."""
    lines, found = path.read_text(encoding="utf-8").splitlines(), []
    for name, node in public(tree_of(path).body):
        docstring = ast.get_docstring(node) or ""
        if SHAPE.search(docstring):
            continue
        if isinstance(node, ast.ClassDef):
            fields = [item for item in node.body if isinstance(item, ast.AnnAssign) and has_array(item.annotation)]
            found += [f"{name}.{ast.unparse(item.target)}" for item in fields if not SHAPE.search(comment(lines, item))]
        else:
            arguments = node.args
            named = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs, arguments.vararg]
            if has_array(node.returns) or any(item is not None and has_array(item.annotation) for item in named):
                found.append(name)
    return found


def comment(lines: list[str], field: ast.AnnAssign) -> str:
    """Give the comment of a field of a class: behind it, or in the lines before it that are nothing else."""
    last = field.end_lineno or field.lineno
    text, above = lines[last - 1].partition("#")[2], field.lineno - 2
    while lines[above].lstrip().startswith("#"):
        text, above = lines[above] + text, above - 1
    return text


def silent(path: Path) -> list[str]:
    """Give the public functions that raise what their docstrings do not name, or name what is no exception."""
    found, known = [], tuples(tree_of(path))
    for name, node in public(tree_of(path).body):
        named = names_raised(ast.get_docstring(node) or "")
        found += [f"{name}: {item} is no exception" for item in sorted(named - exceptions())]
        if isinstance(node, Function):
            found += [f"{name}: {item}" for item in sorted(raised(node, makers(), known) - named)]
    return found


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_raised_exceptions_are_named(path: Path) -> None:
    """A public function that raises an exception names it in a Raises section, and that section names exceptions."""
    assert silent(path) == []


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_arrays_have_shapes(path: Path) -> None:
    """A public function that takes or gives arrays says of what shape, and so does a class that holds some."""
    assert shapeless(path) == []


@pytest.mark.parametrize("path", [path for path in MODULES if ">>>" in path.read_text(encoding="utf-8")], ids=name_of)
def test_examples_in_docstrings(path: Path) -> None:
    """An example in a docstring gives what it says."""
    module = import_module("faultbond." + name_of(path).removesuffix(".py").removesuffix("/__init__").replace("/", "."))
    failed, tried = doctest.testmod(module)
    assert tried
    assert failed == 0


def test_the_readers_of_raised_and_of_shapes() -> None:
    """Statements of raise are read with what makes an exception for them; prose in brackets is no shape."""
    text = (
        "def f():\n  def g(): raise KeyError\n  try: h()\n  except OSError as e: raise e\n  raise m.bad('x') from e\n"
    )
    (function,) = ast.parse(text + "  raise ModelError('x')\n  raise\n  raise NotImplementedError").body
    assert isinstance(function, Function)
    assert raised(function, {"bad": "StructureError"}, {}) == {"StructureError", "ModelError"}
    caught = (
        "BOTH = (KeyError, ValueError)\n"
        "def f():\n  try:\n    raise KeyError\n    raise TypeError\n  except BOTH as e: raise ModelError from e\n"
        "  else: raise ValueError\n  try: raise OSError\n  except OSError: raise\n"
        "  try: raise EOFError\n  except EOFError as e: raise e\n"
    )
    module = ast.parse(caught)
    assert tuples(module) == {"BOTH": {"KeyError", "ValueError"}}
    leaves = {"TypeError", "ModelError", "ValueError", "OSError", "EOFError"}
    assert isinstance(module.body[1], Function)
    assert raised(module.body[1], {}, tuples(module)) == leaves
    assert names_raised("Do.\n\nRaises\n------\nOSError, ModelError\n    Where.\n\nSource\n------\nx") == {
        "OSError",
        "ModelError",
    }
    asked = {"StreamGone", "OSError", "BadZipFile", "NoVerdictError"}
    assert asked - exceptions() == {"StreamGone"}
    for shape in ("(n,)", "(2, n_x)", "(..., n)", "(n + 1, m)", "()", "(n_x, n_x, 3)"):
        assert SHAPE.search(f"of {shape}, SI"), shape
    for prose in ("(SI)", "(of a plant, say)", "(see 4.5)", "f(x)"):
        assert not SHAPE.search(f"it is {prose}"), prose
    lines = ["class A:", "    # (n,), SI", "    x: FloatArray", "    y: FloatArray  # (m,)", "    z: FloatArray"]
    (holder,) = ast.parse("\n".join(lines)).body
    assert isinstance(holder, ast.ClassDef)
    fields = [item for item in holder.body if isinstance(item, ast.AnnAssign)]
    assert [bool(SHAPE.search(comment(lines, item))) for item in fields] == [True, True, False]
