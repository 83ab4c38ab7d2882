"""The imports of the package, read from its source."""

import ast
from functools import cache
from pathlib import Path

SOURCE = Path(__file__).parents[2] / "src" / "faultbond"
MODULES = sorted(SOURCE.rglob("*.py"))
# A unit is a top-level module or package of faultbond. Imports go to a lower level, or stay inside the unit.
LEVELS = {
    "errors": 0,
    "types": 0,
    "arrays": 0,
    "lazy": 0,
    "sets": 0,
    "interrupt": 0,
    "contract": 1,
    "model": 2,
    "runtime": 2,
    "equations": 3,
    "io": 3,
    "diagnosability": 4,
    "algebra": 4,
    "fit": 4,
    "networks": 4,
    "analysis": 5,
    "simulate": 5,
    "synthesis": 6,
    "thesis": 7,
    "report": 8,
    "app": 9,
    "service": 10,
    "api": 11,
    "cli": 11,
    "__main__": 12,
    "__init__": 12,
}


def name_of(path: Path) -> str:
    """Give the path below src/faultbond."""
    return path.relative_to(SOURCE).as_posix()


@cache
def tree_of(path: Path) -> ast.Module:
    """Parse one module, once."""
    return ast.parse(path.read_text(encoding="utf-8"), filename=str(path))


def modules_imported() -> dict[str, set[str]]:
    """Give which modules of the package each one imports, by dotted names; late imports included."""
    named = {f"faultbond.{name_of(path)}".removesuffix(".py").removesuffix("/__init__"): path for path in MODULES}
    known = {name.replace("/", "."): path for name, path in named.items()}
    found: dict[str, set[str]] = {}
    for name, path in known.items():
        targets = set()
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ImportFrom):
                full = [f"{node.module}.{alias.name}" for alias in node.names]
                targets |= {item if item in known else str(node.module) for item in full}
            elif isinstance(node, ast.Import):
                targets |= {alias.name for alias in node.names}
        found[name] = targets & set(known) - {name}
    return found


def units_imported() -> dict[str, set[str]]:
    """Give which top-level modules and packages each of them imports."""
    found: dict[str, set[str]] = {}
    for name, targets in modules_imported().items():
        unit = name.partition(".")[2].partition(".")[0]
        others = {target.partition(".")[2].partition(".")[0] for target in targets}
        found.setdefault(unit, set()).update(others - {unit, ""})
    return {unit: others for unit, others in found.items() if unit and unit != "__main__"}
