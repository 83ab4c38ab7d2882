"""`analyse`: what a plant's sensors can tell of its faults, before a sample is recorded, and on a recording."""

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, TypeVar

from faultbond.app.parameter_names import check_names
from faultbond.app.wishes import Wishes
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.errors import ModelError, StructureError
from faultbond.io.out import Out
from faultbond.model.document import ModelFile
from faultbond.model.graph import BondGraph
from faultbond.model.structure import Structure
from faultbond.model.text import load_any, load_model
from faultbond.model.validity import without_states

if TYPE_CHECKING:
    from faultbond.app.section import Show, Work

_SILENT = 60.0  # s without a word, where standard error is no terminal
_Found = TypeVar("_Found")


def analyse(model: ModelFile, *, wishes: Wishes, out: Out) -> bool:
    """Tell what can be found and told apart, how small, by which routes, and what would help; False: nothing."""
    if out.text is None:
        found = analysed(model, wishes=wishes, tell=lambda _: None)
    else:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        console = Console(file=out.text)

        def tell(show: "Show") -> None:
            show(console)
            console.file.flush()

        found = analysed(model, wishes=wishes, tell=tell)
    out.record(found.record)
    return found.tells


@dataclass(frozen=True, slots=True, kw_only=True)
class Analysed:
    """What an analysis found. tells: whether it found anything beside what the model says."""

    record: Mapping[str, object]
    tells: bool


def analysed(model: ModelFile, *, wishes: Wishes, tell: "Callable[[Show], None]") -> Analysed:
    """Give what can be found and told apart, how small, by which routes, and what would help.

    Parameters
    ----------
    model : the model file
    wishes : what is asked for
    tell : is given how each part is printed, as soon as that is known
    """
    found = load_any(model)
    if isinstance(found, Structure):
        return _analysed_structure(found, wishes, tell)
    graph, network = _equations(found, all_states=wishes.data is not None)
    from faultbond.report.plant import plant_record, print_plant  # noqa: PLC0415 - loads rich

    record = plant_record(graph, network)
    tell(lambda console: print_plant(console, graph, network))
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - needed here alone

    from faultbond.app.study import sections  # noqa: PLC0415 - loads casadi and sympy

    with threadpool_limits(1):  # matrices are small here, and threads would only wait for each other
        found_parts = _work_out(sections(graph, network, wishes), tell)
    return Analysed(record=record | found_parts, tells=bool(found_parts))


def _analysed_structure(structure: Structure, wishes: Wishes, tell: "Callable[[Show], None]") -> Analysed:
    """Tell what equations without laws say of faults."""
    from faultbond.app.structure_study import check_wishes, structure_sections  # noqa: PLC0415 - loads rich
    from faultbond.report.structure import head_record, print_head  # noqa: PLC0415 - loads rich

    check_wishes(structure, wishes)
    tell(lambda console: print_head(console, structure))
    found = _work_out(structure_sections(structure, wishes), tell)
    return Analysed(record=head_record(structure) | found, tells=bool(found))


def _work_out(parts: "Iterator[tuple[str, Work]]", tell: "Callable[[Show], None]") -> dict[str, object]:
    """Work sections out one after the other and tell them; give all that they record, nothing where none is told."""
    from faultbond.report.console import print_refusal  # noqa: PLC0415 - loads rich

    record: dict[str, object] = {}
    progress = _Progress()
    part = progress.through("the model", lambda: next(parts, None))
    while part is not None:
        title, work = part
        try:
            section = progress.through(title, work)
        except StructureError as error:  # what cannot be told is said, and the rest goes on
            tell(partial(print_refusal, heading=title, message=str(error)))
        else:
            record |= section.record
            tell(section.show)
        part = next(parts, None)
    return record


def print_code(model: ModelFile, form: str, *, wishes: Wishes, out: Out) -> None:
    """Print the closed forms of a plant as functions of Python or C, or as LaTeX."""
    name, text = code_of(model, form, wishes=wishes)
    if out.text is not None:
        out.text.write(text)
    out.record({"record": "code", "model": name, "form": form, "text": text})


def code_of(model: ModelFile, form: str, *, wishes: Wishes) -> tuple[str, str]:
    """Give the name of a model, and its closed forms as functions of Python or C, or as LaTeX."""
    graph, network = _plant(model)
    from threadpoolctl import threadpool_limits  # noqa: PLC0415 - needed here alone

    from faultbond.app.answers import answers  # noqa: PLC0415 - loads casadi and sympy
    from faultbond.report.closed_forms import CodeForm, code  # noqa: PLC0415 - loads rich

    with threadpool_limits(1):  # as in `analysed`
        found = answers(graph, network, wishes)
    return graph.name, code(found.found, network.parameters, CodeForm(form), found.forms_left_out)


def trace(model: ModelFile, names: tuple[str, ...], *, out: Out) -> None:
    """Print the thesis' search for the shortest route to a set of parameters, step by step."""
    lines, record = traced(model, names)
    for line in lines:
        out.say(line)
    out.record(record)


def traced(model: ModelFile, names: tuple[str, ...]) -> tuple[Sequence[str], Mapping[str, object]]:
    """Give the thesis' search for the shortest route to a set of parameters, as lines and as a record."""
    graph, network = _plant(model)
    check_names(graph, names)
    from faultbond.app.classic import trace_of  # noqa: PLC0415 - loads casadi and sympy

    return trace_of(graph, network, names)


def _plant(model: ModelFile) -> tuple[BondGraph, ComponentNetwork]:
    """Load a model and give the equations of one of its time frames."""
    return _equations(load_model(model))


def _equations(graph: BondGraph, *, all_states: bool = False) -> tuple[BondGraph, ComponentNetwork]:
    """Give a model with the equations of one of its time frames.

    all_states: of a recording, in which it may not hold all the time; what is asked of no recording is where it does.
    """
    graph = graph if all_states else without_states(graph)
    if graph.is_logic:
        raise ModelError(f"{graph.file}: a logic network has no numbers to analyse; `run` gives all its diagnoses")
    return graph, build_components(graph, build_network(graph, assign_causality(graph)))


class _Progress:
    """Says on standard error what is being worked out: on a terminal always, else once it has taken long."""

    def __init__(self) -> None:
        self.begun = monotonic()

    def through(self, title: str, work: Callable[[], _Found]) -> _Found:
        """Do a part of the work; give what it gives."""
        if sys.stderr.isatty():
            from rich.console import Console  # noqa: PLC0415 - slow to load
            from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn  # noqa: PLC0415

            columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
            with Progress(*columns, console=Console(stderr=True), transient=True) as shown:
                shown.add_task(f"{title} ...", total=None)
                return work()
        gone = monotonic() - self.begun
        if gone > _SILENT:
            sys.stderr.write(f"analyse: {title}, after {gone:.0f} s\n")
            sys.stderr.flush()
        return work()
