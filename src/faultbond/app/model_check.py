"""`check`: what was understood of a model."""

from typing import TYPE_CHECKING

from faultbond.app.engine import engine_title
from faultbond.app.section import Section
from faultbond.io.out import Out
from faultbond.model.document import ModelFile
from faultbond.model.structure import Structure
from faultbond.model.text import load_any

if TYPE_CHECKING:
    from rich.console import Console


def check(model: ModelFile, *, out: Out, settings: bool = False) -> None:
    """Tell what was understood of a model, with the numbers of the method if these are asked for."""
    write(understood(model, settings=settings), out)


def write(found: Section, out: Out) -> None:
    """Write what a verb found: the record, and the text where somebody reads it."""
    out.record(found.record)
    if out.text is not None:
        from rich.console import Console  # noqa: PLC0415 - slow to load

        found.show(Console(file=out.text))


def understood(model: ModelFile, *, settings: bool = False) -> Section:
    """Give what was understood of a model; its text shows the numbers of the method if these are asked for."""
    graph = load_any(model)
    if isinstance(graph, Structure):
        return _of_structure(graph)
    title = engine_title()
    from faultbond.report.inventory import Inventory, check_record  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.engine import build_model  # noqa: PLC0415 - loads casadi
    from faultbond.synthesis.specify import build_spec  # noqa: PLC0415 - loads casadi

    step_model = build_model(graph)
    seen = Inventory(graph=graph, model=step_model, spec=build_spec(step_model), engine=title)

    def show(console: "Console") -> None:
        from faultbond.report.inventory import print_check  # noqa: PLC0415 - loads rich

        print_check(console, seen, settings=settings)

    return Section(record=check_record(seen), show=show)


def _of_structure(structure: Structure) -> Section:
    """Give what was understood of equations without laws."""
    from faultbond.report.structure import print_equations, structure_check_record  # noqa: PLC0415 - loads rich

    record = structure_check_record(structure)
    return Section(record=record, show=lambda console: print_equations(console, structure))
