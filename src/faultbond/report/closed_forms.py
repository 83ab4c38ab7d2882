"""Routes and closed forms: as keys of the record of an analysis, as text for people, and as code."""

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from enum import Enum
from itertools import chain, count

from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from faultbond.algebra.routes.functions import Function, components_passed, equations_passed
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
    to_one_line,
    to_python,
)
from faultbond.algebra.solving.latex import to_latex
from faultbond.algebra.solving.solution import Solution
from faultbond.contract.json_records import Record
from faultbond.equations.component_network import ComponentNetwork, frame_name
from faultbond.model.parser import to_text
from faultbond.report.console import table, title
from faultbond.report.numbers import short, with_noun

UNSOLVED = 6  # sets of several parameters without a closed form that are listed
LONGEST = 1500  # letters of a closed form on a terminal


class CodeForm(Enum):
    """How closed forms are written for other programs."""

    LATEX = "latex"
    PYTHON = "python"
    C = "c"


_REMARKS = {CodeForm.LATEX: "% {}", CodeForm.PYTHON: "# {}", CodeForm.C: "/* {} */"}


def routes_record(network: ComponentNetwork, found: Sequence[Function], late: int, unsought: int = 0) -> Record:
    """Give the route of each function, and its closed form where it was asked for, in time, and there is one."""
    routes = []
    for item in found:
        targets = [target if isinstance(target, str) else frame_name(target) for target in item.question.targets]
        record: Record = {"target": ", ".join(targets), "question": item.question.title}
        route, solution = item.route, item.solution
        if route is None:
            record |= {"components": [], "observations": None, "equations": None, "closed_form": None}
            routes.append(record | {"refusal": item.refusal})
            continue
        steps = list(equations_passed(network, route))
        record |= {
            "components": list(components_passed(network, route)),
            "observations": route.observations,
            "equations": len(steps),
            "closed_form": None if solution is None else to_one_line(solution),
            "steps": steps,
            "samples": [frame_name(sample) for sample in route.samples],
            "frames": route.frames,
            "largest_block": route.largest_block,
            "noise": None if item.gain is None else dict(item.gain.deviations),
        }
        if solution is not None:
            record |= {
                "kind": solution.kind.value,
                "degree": solution.degree,
                "real_roots": solution.real_roots,
                "singular": [singular.words for singular in solution.singular],
                "remarks": list(solution.remarks),
            }
        routes.append(record)
    return {"routes": routes, "closed_forms_left_out": late, "routes_left_out": unsought}


def print_routes(
    console: Console, network: ComponentNetwork, found: Sequence[Function], late: int, unsought: int = 0
) -> None:
    """Print a line for each function, then the closed forms; `late` of them, `unsought` routes had no time."""

    def remark(text: str) -> None:
        console.print(Padding(Text(text, style="dim"), (0, 0, 0, 1)))

    what = "components passed, samples used, noise by these alone"
    title(console, "How it follows from the measurements", what)
    several = [item for item in found if _is_unsolved_set(item)]
    shown = [*(item for item in found if not _is_unsolved_set(item)), *several[:UNSOLVED]]
    table(
        console, ("what", "components", "samples", "noise (sd, SI)", "solved"), [_row(network, item) for item in shown]
    )
    if len(several) > UNSOLVED:
        remark(f"... and {len(several) - UNSOLVED} more sets of parameters; --json writes all")
    for item in found:
        if item.solution is not None and item.solution.roots:
            console.print(Text(f" {item.question.title}", style="bold"))
            for line in _closed(item.solution):
                console.print(Padding(Text(line), (0, 0, 0, 3)))
    if late:
        remark(_left_out(late))
    if unsought:
        remark(f"{with_noun(unsought, 'route')} left out, the time was over; `--budget` gives more")


def _is_unsolved_set(item: Function) -> bool:
    """Whether several parameters were asked for, and there is no closed form."""
    return item.solution is None and sum(isinstance(target, str) for target in item.question.targets) > 1


def _left_out(late: int) -> str:
    return f"{with_noun(late, 'closed form')} left out, the time was over; `--patience` gives more"


def _row(network: ComponentNetwork, item: Function) -> tuple[str, ...]:
    """Give a line of the table; the noise of a parameter that is not 0 is in per cent of its value."""
    if item.route is None:
        return (item.question.title, "no route", "", "", "")
    gain = item.gain
    noises = [_noise(value, name in gain.relative) for name, value in gain.deviations.items()] if gain else []
    solved = ""
    if item.solution is not None:
        n_roots = len(item.solution.roots)
        roots = "" if n_roots == 1 else f", {n_roots} closed forms"
        solved = f"{item.solution.kind.value}{roots}" if n_roots else "no closed form"
    passed = str(len(equations_passed(network, item.route)))
    return item.question.title, passed, str(item.route.observations), ", ".join(noises), solved


def _noise(value: float, relative: bool) -> str:
    if math.isinf(value):
        return "singular"
    if not relative:
        return short(value)
    return f"{short(100 * value)} %" if value < 1.0 else f"{short(value)} times its value"


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
            origins = chain(("", question), (f"{question} {number}" for number in count(2)))  # the shortest first
            names = ((origin, re.sub(r"[\W_]+", "_", f"{formula.target} of {origin}").strip("_")) for origin in origins)
            origin, name = next(item for item in names if item[1] not in before)
            taken.add(name)
            yield replace(formula, origin=origin)
