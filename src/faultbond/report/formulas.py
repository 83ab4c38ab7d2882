"""Routes and closed forms, as text for people and as code."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from itertools import count

from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from faultbond.algebra.routes.functions import Function, equations_passed
from faultbond.algebra.solving.formula import (
    C_HEADER,
    PYTHON_HEADER,
    Formula,
    conditions_text,
    formulas,
    readable_lines,
    shown_conditions,
    to_c,
    to_lines,
    to_python,
)
from faultbond.algebra.solving.latex import to_latex
from faultbond.algebra.solving.solution import Solution
from faultbond.equations.component_network import ComponentNetwork
from faultbond.model.parser import to_text
from faultbond.report.console import table, title

LISTED = 24  # sets of several parameters without a closed form that are listed
LONGEST = 1500  # letters of a closed form on a terminal


class CodeForm(Enum):
    """How closed forms are written for other programs."""

    LATEX = "latex"
    PYTHON = "python"
    C = "c"


_REMARKS = {CodeForm.LATEX: "% {}", CodeForm.PYTHON: "# {}", CodeForm.C: "/* {} */"}


def print_routes(console: Console, network: ComponentNetwork, found: Sequence[Function], late: int) -> None:
    """Print a line for each function, then the closed forms; `late` of them there was no time for."""
    title(console, "How it follows from the measurements", "components passed, samples used, noise of the result")
    kept = [item for item in found if not _is_of_several(item) or item.solution is not None]
    several = [item for item in found if item not in kept]
    shown = [*kept, *several[:LISTED]]
    table(console, ("what", "components", "samples", "noise (sd)", "solved"), [_row(network, item) for item in shown])
    if len(several) > LISTED:
        text = f"... and {len(several) - LISTED} more sets of parameters; --json writes all"
        console.print(Padding(Text(text, style="dim"), (0, 0, 0, 1)))
    for item in found:
        if item.solution is not None and item.solution.roots:
            console.print(Text(f" {item.question.title}", style="bold"))
            for line in _closed(item.solution):
                console.print(Padding(Text(line), (0, 0, 0, 3)))
    if late:
        console.print(Padding(Text(_left_out(late), style="dim"), (0, 0, 0, 1)))


def _is_of_several(item: Function) -> bool:
    """Whether several parameters were asked for."""
    return sum(isinstance(target, str) for target in item.question.targets) > 1


def _left_out(late: int) -> str:
    return f"{late} closed form{'s'[: late != 1]} left out, the time was over; `--patience` gives more"


def _row(network: ComponentNetwork, item: Function) -> tuple[str, ...]:
    if item.route is None:
        return (item.question.title, "no route", "", "", "")
    passed = str(len(equations_passed(network, item.route)))
    return (item.question.title, passed, str(item.route.observations), _noise(item), _solved(item.solution))


def _noise(item: Function) -> str:
    """The noise of each target; of a parameter that is not 0 in per cent of its value."""
    if item.gain is None:
        return ""
    return ", ".join(_gain(value, name in item.gain.relative) for name, value in item.gain.deviations.items())


def _gain(value: float, relative: bool) -> str:
    if math.isinf(value):
        return "singular"
    if not relative:
        return f"{value:.2g}"
    return f"{100 * value:.2g} %" if value < 1.0 else f"{value:.2g} times its value"


def _solved(solution: Solution | None) -> str:
    if solution is None:
        return ""
    if not solution.roots:
        return "no closed form"
    roots = "" if len(solution.roots) == 1 else f", {len(solution.roots)} closed forms"
    return f"{solution.kind.value}{roots}"


def _closed(solution: Solution) -> Iterator[str]:
    """Give the lines of the closed forms, what holds for them, and where they have no value."""
    for number, root in enumerate(solution.roots, start=1):
        if len(solution.roots) > 1:
            yield f"({number})"
        for line in to_lines(root, solution.targets):
            yield line if len(line) <= LONGEST else f"{line[:LONGEST]} ... ({len(line)} letters; --json writes all)"
        conditions = conditions_text(shown_conditions(root, readable_lines(root, solution.targets)))
        if conditions:
            yield f"where {conditions}"
    for singular in solution.singular:
        yield f"{to_text(singular.expression)}: {singular.words}"
    yield from solution.remarks


def code(found: Sequence[Function], parameters: Sequence[str], form: CodeForm, late: int = 0) -> str:
    """Give all closed forms as functions of a language, or as LaTeX; a remark if `late` others are left out."""
    solved = [(item.question.title, item.solution) for item in found if item.solution is not None]
    if form is CodeForm.LATEX:
        parts = [
            f"% {title}\n{to_latex(root, solution.targets)}" for title, solution in solved for root in solution.roots
        ]
    else:
        header, write = (PYTHON_HEADER, to_python) if form is CodeForm.PYTHON else (C_HEADER, to_c)
        parts = [header, *(write(formula) for formula in _named(solved, parameters))]
    if late:
        parts.append(_REMARKS[form].format(_left_out(late)))
    return "\n\n".join(part.strip("\n") for part in parts) + "\n"


def _named(solved: Sequence[tuple[str, Solution]], parameters: Sequence[str]) -> Iterator[Formula]:
    """Give the formulas, no two of one name: a target given before is told apart by the title of the question."""
    taken: set[str] = set()
    for question, solution in solved:
        before = frozenset(taken)
        for formula in formulas(solution, parameters):
            origin = next(item for item in _origins(question) if _word(formula.target, item) not in before)
            taken.add(_word(formula.target, origin))
            yield replace(formula, origin=origin)


def _origins(question: str) -> Iterator[str]:
    """Give words on where a formula comes from, the shortest first."""
    yield ""
    yield question
    yield from (f"{question} {number}" for number in count(2))


def _word(target: str, origin: str) -> str:
    """Give what is left of a target and its origin in the name of a function."""
    return re.sub(r"[\W_]+", "_", f"{target} of {origin}").strip("_")
