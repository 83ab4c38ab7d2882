"""The shape of the package: who may import whom, where, and how long things may be."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from imports import LEVELS, MODULES, SOURCE, modules_imported, name_of, tree_of

SYMBOLIC = {
    "casadi": {"equations", "analysis", "fit", "networks", "simulate", "synthesis"},
    "sympy": {"algebra", "networks", "thesis"},
}
DOOR = "app/classic.py"  # the only module outside it that may import the thesis' own method
RUNTIME_NEEDS = {"numpy"}
# Imports that may stand inside a function: what is slow to load or need not be installed.
LATE_IMPORTS = (
    ("model", "pint"),
    ("io", "pyarrow"),
    ("synthesis", "casadi"),
    ("app", "faultbond.analysis"),  # loads casadi and sympy
    ("app", "faultbond.app.answers"),  # loads sympy
    ("app", "faultbond.app.network_run"),  # loads casadi and sympy
    ("app", "faultbond.app.self_test"),  # loads casadi and scipy
    ("app", "faultbond.app.quiet_fit"),  # loads casadi and scipy
    ("app", "faultbond.app.markers"),  # after an alarm only
    ("app", "faultbond.app.standstill"),  # hardly ever
    ("app", "faultbond.app.stated_starts"),  # after an alarm only
    ("app", "faultbond.app.unfamiliar"),  # after an alarm only
    ("app", "faultbond.app.unit_guess"),  # loads the units
    ("app", "faultbond.model.text"),  # loads yaml
    ("app", "faultbond.app.classic"),  # loads casadi and sympy
    ("app", "faultbond.app.structure_study"),  # loads rich and scipy
    ("app", "faultbond.app.study"),  # loads casadi and sympy
    ("app", "faultbond.synthesis"),  # loads casadi
    ("app", "faultbond.equations"),  # loads scipy
    ("app", "faultbond.fit"),  # loads casadi and scipy
    ("app", "faultbond.networks"),  # loads casadi and sympy
    ("app", "faultbond.simulate"),  # loads casadi and scipy
    ("app", "faultbond.report"),  # loads rich and jinja2
    ("app", "rich"),
    ("app", "threadpoolctl"),
    ("service", "faultbond.app.self_test"),  # loads casadi and scipy
    ("service", "faultbond.service.sinks.mqtt"),  # needs aiomqtt
    ("service", "faultbond.service.sinks.opcua"),  # needs asyncua
    ("service", "faultbond.service.sources.mqtt"),  # needs aiomqtt
    ("service", "faultbond.service.sources.opcua"),  # needs asyncua
    ("service", "faultbond.service.sources.opcua_identity"),  # the same
    ("service", "faultbond.service.sources.sparkplug"),  # needs protobuf
    ("service", "faultbond.service.store.postgresql"),  # needs psycopg
    ("service", "faultbond.simulate"),  # loads casadi and scipy
    ("service", "faultbond.synthesis"),  # loads casadi
    ("api", "faultbond.api.plot"),  # needs matplotlib
    ("api", "matplotlib"),
    ("api", "pandas"),
    ("api", "polars"),
    ("api", "pyarrow"),
    ("api", "rich"),
    ("cli", "faultbond.service"),  # not all need it
    ("cli", "importlib.metadata"),
    ("service", "fastapi"),  # extras
    ("service", "pyarrow"),
    ("service", "uvicorn"),
    ("service", "faultbond.service.web"),  # loads fastapi
    ("service", "faultbond.report.drawing"),  # loads scipy
    ("cli", "faultbond.model.quantities"),
)
MAX_MODULE_LINES = 600
MAX_FUNCTION_LINES = 100
FORBIDDEN_CALLS = {"print", "eval", "exec"}


def unit_of(path: Path) -> str:
    """Give the top-level module or package that a file belongs to."""
    return path.relative_to(SOURCE).parts[0].removesuffix(".py")


def imports(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Give (line, dotted name) of every import; relative ones start with a dot."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((node.lineno, alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            if module == "faultbond":
                yield from ((node.lineno, f"faultbond.{alias.name}") for alias in node.names)
            else:
                yield node.lineno, module


def unit_breaches(tree: ast.AST, unit: str) -> list[str]:
    """Give the lines of a module that import what its level may not."""
    found = []
    for line, module in imports(tree):
        first, _, rest = module.partition(".")
        target = rest.partition(".")[0]
        if first == "":
            found.append(f"{line}: {module} is relative")
        elif first == "faultbond" and not target:
            found.append(f"{line}: imports the whole package")
        elif first == "faultbond" and target != unit and LEVELS.get(target, 99) >= LEVELS[unit]:
            found.append(f"{line}: {unit} (level {LEVELS[unit]}) may not import {target}")
    return found


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_go_down(path: Path) -> None:
    """A module imports lower levels only, by absolute names."""
    assert unit_of(path) in LEVELS, f"{name_of(path)} has no level: add it to LEVELS and to docs/decisions"
    assert unit_breaches(tree_of(path), unit_of(path)) == []


def test_a_breach_is_found() -> None:
    """The check above sees upward, sideways, relative and whole-package imports."""
    text = "import faultbond\nfrom . import spec\nfrom faultbond import app\nfrom faultbond.model.graph import Bond\n"
    breaches = unit_breaches(ast.parse(text), "runtime")
    assert [breach.split(":")[0] for breach in breaches] == ["1", "2", "3", "4"]


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_imports_in_functions_are_listed(path: Path) -> None:
    """An import inside a function is one of the few that may come late."""
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            for line, module in imports(node):
                allowed = [late for unit, late in LATE_IMPORTS if unit == unit_of(path)]
                assert any(f"{module}.".startswith(f"{late}.") for late in allowed), f"line {line}: {module}"


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_symbolic_packages_stay_where_laws_become_numbers(path: Path) -> None:
    """Few packages import casadi, and fewer sympy."""
    used = {module.partition(".")[0] for _, module in imports(tree_of(path))}
    assert [name for name, units in SYMBOLIC.items() if name in used and unit_of(path) not in units] == []


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_one_door_leads_to_the_thesis(path: Path) -> None:
    """The thesis' own method is imported by itself and by one module."""
    used = {module.partition(".")[2].partition(".")[0] for _, module in imports(tree_of(path))}
    assert "thesis" not in used or unit_of(path) == "thesis" or name_of(path) == DOOR


def circles(arrows: dict[str, set[str]]) -> set[str]:
    """Give what lies on a circle, or between two."""
    left = {name: set(targets) for name, targets in arrows.items()}
    while True:
        reached = {target for targets in left.values() for target in targets}
        ends = [name for name, targets in left.items() if not targets & set(left) or name not in reached]
        if not ends:
            return set(left)
        for name in ends:
            del left[name]


def test_no_circles_of_modules() -> None:
    """No module imports another that leads back to it."""
    assert circles(modules_imported()) == set()


def test_no_circles_of_folders() -> None:
    """No folder imports another that leads back to it."""
    arrows: dict[str, set[str]] = {}
    packages = {"faultbond." + name_of(path.parent).replace("/", ".") for path in MODULES if path.parent != SOURCE}

    def folder(name: str) -> str:
        return name if name in packages else name.rpartition(".")[0]

    for name, targets in modules_imported().items():
        arrows.setdefault(folder(name), set()).update(folder(target) for target in targets)
    arrows.pop("faultbond")  # the root holds what is below all, and what is above all
    assert circles({name: {item for item in targets if item != name} for name, targets in arrows.items()}) == set()


def test_a_circle_is_found() -> None:
    """The check above sees a circle, and nothing of what only leads to it."""
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b", "d"}, "d": set()}) == {"b", "c"}


@pytest.mark.parametrize(
    "path",
    [path for path in MODULES if unit_of(path) in {"runtime", "contract"} or "thesis/online" in name_of(path)],
    ids=name_of,
)
def test_runtime_needs_numpy_only(path: Path) -> None:
    """What runs beside the plant needs numpy, the standard library, and levels 0 and 1."""
    outside = {module.partition(".")[0] for _, module in imports(tree_of(path))} - sys.stdlib_module_names
    assert outside <= RUNTIME_NEEDS | {"faultbond"}


def test_runtime_loads_no_design_time_package() -> None:
    """Importing the run time loads no design-time library by a detour."""
    heavy = sorted({*SYMBOLIC, "pint", "scipy", "jinja2", "rich"})  # yaml is light, and `faultbond` offers load_model
    check = f"sys.exit([n for n in {heavy} if n in sys.modules] or 0)"
    code = f"import sys, faultbond.runtime.monitor, faultbond.contract.spec; {check}"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stderr.strip() == ""


@pytest.mark.parametrize("package", sorted({path.parent for path in MODULES} - {SOURCE}), ids=name_of)
def test_no_package_is_empty(package: Path) -> None:
    """A package has its `__init__.py` and at least one module."""
    files = {path.name for path in package.glob("*.py")}
    assert "__init__.py" in files
    assert len(files) > 1 or any(child.is_dir() for child in package.glob("[a-z]*"))


@pytest.mark.parametrize("package", sorted({path.parent for path in MODULES} - {SOURCE}), ids=name_of)
def test_packages_say_what_passes_through_them(package: Path) -> None:
    """A package says what goes in, what comes out, and in which order its modules are read; these are there."""
    text = ast.get_docstring(tree_of(package / "__init__.py")) or ""
    assert [word for word in ("In: ", "Out: ", "Read ") if word not in text] == []
    named = re.findall(r"`([a-z_]+)`", text.partition("Read ")[2])
    assert named
    assert [name for name in named if not ((package / f"{name}.py").exists() or (package / name).is_dir())] == []


@pytest.mark.parametrize("path", [path for path in MODULES if path.name == "__init__.py"], ids=name_of)
def test_init_files_hold_no_code(path: Path) -> None:
    """An `__init__.py` holds a docstring, absolute imports and lists of names; those loaded late are the typed ones."""
    typed: dict[str, str] = {}
    late: dict[str, str] = {}
    for node in tree_of(path).body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            assert all(isinstance(item, ast.ImportFrom) for item in node.body)
            for item in node.body:
                if isinstance(item, ast.ImportFrom):
                    typed |= {alias.name: str(item.module) for alias in item.names}
        elif isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__getattr__":
            assert isinstance(node.value, ast.Call)
            package, homes = (ast.literal_eval(item) for item in node.value.args)
            late = {name: f"{package}.{module}" for module, names in homes.items() for name in names.split()}
        else:
            docstring = isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
            listing = isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["__all__"]
            assert docstring or listing or isinstance(node, ast.ImportFrom), f"line {node.lineno}"
    assert late == typed


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_sizes(path: Path) -> None:
    """A module has at most 600 lines, a function at most 100."""
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_MODULE_LINES
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            assert (node.end_lineno or 0) - node.lineno + 1 <= MAX_FUNCTION_LINES, node.name


@pytest.mark.parametrize("path", MODULES, ids=name_of)
def test_no_forbidden_calls(path: Path) -> None:
    """The package prints nothing and executes no text."""
    calls = [node.func for node in ast.walk(tree_of(path)) if isinstance(node, ast.Call)]
    called = {function.id for function in calls if isinstance(function, ast.Name)}
    assert called & FORBIDDEN_CALLS == set()


# Names. What two modules may both call so, and why: the two methods are taken for each other, so they have one face.
FACES = {  # name -> folders, one module of each
    "accept": {"thesis/online", "app", "api"},  # the verbs of `app` pass on to what has their name
    "reject": {"thesis/online", "app", "api"},
    "simulate": {"simulate", "app", "api"},
    "analyse": {"app", "api"},  # a verb is a function of that name in Python
    "check": {"app", "api"},
    "fit": {"app", "api"},
    "run": {"app", "api"},
    "trace": {"app", "api"},
    "demo": {"app", "api"},
    "doctor": {"app", "api"},
    "serve": {"service", "api"},
    "code": {"report", "api"},
    "example": {"io", "api"},  # the folder, and the model in it
    "Monitor": {"runtime", "api"},  # that of Python knows columns and units, that below it numbers
    "Simulation": {"simulate", "api"},
}
ENDINGS = ("s", "es", "d", "ed", "r", "er", "y", "ing")
NOUNS = {  # modules with the ending of a gerund that are things
    "opening": "the way in to a source, as of a letter box",
    "matching": "pairs of equations and unknowns, a term of graph theory",
    "recording": "a file of what was measured",
    "drawing": "a picture",
    "ranking": "an order of hypotheses",
    "wiring": "who is connected to whom",
    "builder": "the pattern of that name: parts are added, then the whole is asked for",
}


def is_alias(node: ast.stmt) -> bool:
    """Whether a statement names a type; names of constants have capitals only."""
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return any(isinstance(item, ast.Name) and item.id[:1].isupper() and not item.id.isupper() for item in targets)


def homes_of_names() -> dict[str, list[str]]:
    """Give the modules in which each public function, class or type alias stands."""
    homes: dict[str, list[str]] = {}
    for path in MODULES:
        for node in tree_of(path).body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                names = [node.name]
            elif isinstance(node, ast.Assign) and is_alias(node):
                names = [ast.unparse(item) for item in node.targets]
            elif isinstance(node, ast.AnnAssign) and is_alias(node):
                names = [ast.unparse(node.target)]
            else:
                continue
            for name in names:
                if not name.startswith("_"):
                    homes.setdefault(name, []).append(name_of(path))
    return homes


def shared(homes: dict[str, list[str]]) -> dict[str, list[str]]:
    """Give the names with several homes, but for the faces of the methods."""
    several = {name: paths for name, paths in homes.items() if len(paths) > 1}
    folders = {name: [path.rpartition("/")[0] for path in paths] for name, paths in several.items()}
    faces = [
        name for name, found in folders.items() if len({*found}) == len(found) and {*found} <= FACES.get(name, set())
    ]
    return {name: paths for name, paths in several.items() if name not in faces}


def longer(words: set[str]) -> dict[str, str]:
    """Give the words that are another one with an ending, and that one; an `e` or a doubled letter may be between."""
    stems = {word[:-1] if word.endswith("e") else word: word for word in words}
    found = {}
    for word in words:
        for ending in ENDINGS:
            stem = word.removesuffix(ending)
            for short in (stem, stem[:-1] if stem[-2:-1] == stem[-1:] else stem):
                if word.endswith(ending) and stems.get(short, word) != word:
                    found[word] = stems[short]
    return found


def module_words() -> set[str]:
    """Give the names of the modules."""
    return {path.stem for path in MODULES if not path.name.startswith("__")}


def breaches_of_modules(words: set[str]) -> dict[str, str]:
    """Give the modules with a name that says too little, and why."""
    acts = {word: "an act, not a thing" for word in words if word.endswith("ing") and word not in NOUNS}
    return acts | {word: f"nearly {other!r}" for word, other in longer(words).items() if word not in NOUNS}


def test_no_two_things_have_one_name() -> None:
    """A public function, class or type alias has a name of its own, so that who meets it knows which one it is."""
    assert shared(homes_of_names()) == {}


def test_faces_are_shared() -> None:
    """Each face of the methods stands where the table says."""
    homes = homes_of_names()
    assert {name: {path.rpartition("/")[0] for path in homes.get(name, [])} for name in FACES} == FACES


def test_modules_are_nouns_of_their_own() -> None:
    """No module is called by an act, nor by the name of another one with an ending."""
    found = breaches_of_modules(module_words())
    assert found == {}
    assert NOUNS.keys() <= module_words()


def test_names_are_compared() -> None:
    """The checks above see endings, gerunds, and a face that stands twice in one folder."""
    assert longer({"chart", "charts", "fit", "fitted", "estimate", "estimates", "noise", "noisy", "class"}) == {
        "charts": "chart",
        "fitted": "fit",
        "estimates": "estimate",
        "noisy": "noise",
    }
    assert set(breaches_of_modules({"naming", "matching", "alarm"})) == {"naming"}
    homes = {"accept": ["app/decision.py", "thesis/online/decision.py"], "reject": ["app/a.py", "app/b.py"]}
    assert set(shared(homes | {"x": ["fit/a.py", "io/b.py"], "y": ["fit/a.py"]})) == {"reject", "x"}
